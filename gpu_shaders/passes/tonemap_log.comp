// SPDX-License-Identifier: GPL-3.0-or-later
// Logarithms of a picture's luminances, with their squares, as far as there are any.
#include "lib/tonemap.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = PICTURE_UNIT) uniform sampler2D picture;
layout(rgba32f, binding = 0) writeonly uniform image2D result;  // 1 or 0 where there is no light; log; its square

uniform float middle;   // stops: what counts as 0
uniform float reach;    // stops, to both sides, where logarithms are cut

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    float luminance = rec709_luminance(texelFetch(picture, pixel, 0).rgb);
    // As a whole number: drivers may take any comparison with NaN for true.
    uint bits = floatBitsToUint(luminance);
    bool is_lit = bits >= floatBitsToUint(SMALLEST) && bits < floatBitsToUint(LARGEST);
    float stops = is_lit ? clamp(log2(luminance) - middle, -reach, reach) : 0.0;
    imageStore(result, pixel, vec4(is_lit ? 1.0 : 0.0, stops, stops * stops, 0.0));
}
