// SPDX-License-Identifier: GPL-3.0-or-later
// Adds the directions that are open as all views together tell, and how many directions there are.
#include "passes/gbuffer_samplers.glsl"
#include "passes/ambient_occlusion_points.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32ui, binding = 0) readonly uniform uimage2D told_points;
layout(rg32f, binding = 1) uniform image2D sums;

uniform int directions, steps; // of this run

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(sums))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    uvec4 told = imageLoad(told_points, pixel);
    float open = 0.0;
    for (int i = 0; i < directions; ++i) {
        bool is_open = true;
        for (int j = 0; j < steps; ++j) {
            is_open = is_open && !is_in_the_way(told_of(told, i * steps + j));
        }
        open += is_open ? 1.0 : 0.0;
    }
    imageStore(sums, pixel, imageLoad(sums, pixel) + vec4(open, float(directions), 0.0, 0.0));
}
