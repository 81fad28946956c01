// SPDX-License-Identifier: GPL-3.0-or-later
// The construction of seed 002, 4.2: every cell looks through all lights and keeps those whose active hemisphere
// reaches it, in a list of fixed length whose empty slots name a light that emits nothing.
// Of every group_step groups of cells one is built, so that a long run can be measured in part.
#include "gpu_layout/HalfBall"
#include "lib/active_hemisphere.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = 0) readonly buffer HalfBalls { HalfBall half_balls[]; };
// Faces of the cells along x, then along y, then along z.
layout(std430, binding = 1) readonly buffer Edges { float edges[]; };
layout(std430, binding = 2) writeonly buffer Lists { uint lists[]; };
layout(std430, binding = 3) buffer Counts { uint counts[]; };

uniform uint cells_per_axis;
uniform uint light_count;
uniform uint max_lights;
uniform uint first_light; // of this run: Mesa's llvmpipe ends an invocation's loops after 65,535 rounds in all
uniform uint end_light;
uniform uint group_step;
uniform uint first_group;

void main() {
    uint group = first_group + gl_WorkGroupID.x;
    uint cell = group * group_step * GROUP_SIZE + gl_LocalInvocationID.x;
    if (cell >= cells_per_axis * cells_per_axis * cells_per_axis) {
        return;
    }
    uvec3 place = uvec3(cell, cell / cells_per_axis, cell / (cells_per_axis * cells_per_axis)) % cells_per_axis;
    uvec3 face = place + uvec3(0u, 1u, 2u) * (cells_per_axis + 1u);
    vec3 low = vec3(edges[face.x], edges[face.y], edges[face.z]);
    vec3 high = vec3(edges[face.x + 1u], edges[face.y + 1u], edges[face.z + 1u]);

    uint slot = group * GROUP_SIZE + gl_LocalInvocationID.x;
    uint count = first_light == 0u ? 0u : counts[slot];
    for (uint light = first_light; light < end_light && count < max_lights; ++light) {
        if (half_ball_overlaps(half_balls[light], low, high)) {
            lists[slot * max_lights + count] = light;
            ++count;
        }
    }
    counts[slot] = count;
    for (; end_light == light_count && count < max_lights; ++count) {
        lists[slot * max_lights + count] = light_count;
    }
}
