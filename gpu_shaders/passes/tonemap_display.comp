// SPDX-License-Identifier: GPL-3.0-or-later
// A picture as a display shows it: the base of each pixel's luminance with less contrast, its detail as it is.
#include "lib/tonemap.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = PICTURE_UNIT) uniform sampler2D picture;
layout(binding = BASE_UNIT) uniform sampler2D bases;    // as tonemap_base.comp leaves them
layout(rgba32f, binding = 0) writeonly uniform image2D result;

uniform float middle;   // stops, of the luminance that becomes KEY
uniform float contrast; // of the base, in display stops for each stop

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    vec4 color = texelFetch(picture, pixel, 0);
    vec4 base = texelFetch(bases, pixel, 0);
    vec3 shown = vec3(0.0);
    if (base.x > 0.0) {
        float luminance = rec709_luminance(color.rgb);
        float stops = log2(luminance) - middle - (1.0 - contrast) * base.y;
        // Beyond white and below what float32 holds, all the same.
        float bright = photographic_curve(KEY * exp2(clamp(stops, -100.0, 100.0)), WHITE);
        shown = within_display(max(color.rgb, 0.0) / luminance * bright, bright);
    }
    bool has_alpha = floatBitsToUint(color.a) <= floatBitsToUint(1.0);
    imageStore(result, pixel, vec4(shown, has_alpha ? color.a : 1.0));
}
