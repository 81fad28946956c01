// SPDX-License-Identifier: GPL-3.0-or-later
// Light that two techniques have found, together.

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32f, binding = 0) writeonly uniform image2D irradiance;  // W/m²; w: 0
layout(rgba32f, binding = 1) readonly uniform image2D of_chosen;    // W/m²
layout(rgba32f, binding = 2) readonly uniform image2D of_rest;      // W/m²

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(irradiance)))) {
        vec3 sum = imageLoad(of_chosen, pixel).rgb + imageLoad(of_rest, pixel).rgb;
        imageStore(irradiance, pixel, vec4(sum, 0.0));
    }
}
