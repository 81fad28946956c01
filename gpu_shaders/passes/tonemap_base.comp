// SPDX-License-Identifier: GPL-3.0-or-later
// The base of each pixel's logarithm: smooth, with the edges of the picture (He, Sun and Tang 2010, eq. 8).

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = LOG_UNIT) uniform sampler2D logs;
layout(binding = FIT_UNIT) uniform sampler2D fits;  // sums of lines around the pixel, as tonemap_fit.comp leaves them
layout(rgba32f, binding = 0) writeonly uniform image2D result;  // 1 or 0, base, its square

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    vec4 own = texelFetch(logs, pixel, 0), sums = texelFetch(fits, pixel, 0);
    vec2 line = sums.yz / max(sums.x, 1.0);
    float base = own.x * (line.x * own.y + line.y);
    imageStore(result, pixel, vec4(own.x, base, base * base, 0.0));
}
