// SPDX-License-Identifier: GPL-3.0-or-later
// The sum of light and negative light, which is never less than none (seed 001, 3.4).

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32f, binding = 0) uniform image2D irradiance; // W/m²; w: what was taken away, mean of the channels

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(irradiance)))) {
        vec4 total = imageLoad(irradiance, pixel);
        imageStore(irradiance, pixel, vec4(max(total.rgb, 0.0), total.w));
    }
}
