// SPDX-License-Identifier: GPL-3.0-or-later
// The line that stands for the logarithms around each pixel: flat where they differ by little, themselves where by much
// (He, Sun and Tang 2010, eq. 5 and 6, guided by itself).

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = LOG_UNIT) uniform sampler2D logs;          // of the pixel, as tonemap_log.comp leaves them
layout(binding = MOMENT_UNIT) uniform sampler2D moments;    // sums of them around it
layout(rgba32f, binding = 0) writeonly uniform image2D result;  // 1 or 0, slope, offset

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    float weight = texelFetch(logs, pixel, 0).x;
    vec4 sums = texelFetch(moments, pixel, 0);
    vec2 means = sums.yz / max(sums.x, 1.0);
    float variance = max(means.y - means.x * means.x, 0.0);
    float slope = variance / (variance + EDGE_VARIANCE);
    imageStore(result, pixel, weight * vec4(1.0, slope, (1.0 - slope) * means.x, 0.0));
}
