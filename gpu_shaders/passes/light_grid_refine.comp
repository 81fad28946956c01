// SPDX-License-Identifier: GPL-3.0-or-later
// The lists of blocks of cells from the lists of the blocks of the next larger size that hold them (seed 002, 4.2).
// One invocation looks at one part of one list, in order, so the lists ascend however the device schedules it.
// FILL: write lights where the counts of an earlier run, summed up, say. EXACT: blocks are cells.
#include "gpu_layout/HalfBall"
#include "lib/active_hemisphere.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = HALF_BALL_BINDING) readonly buffer HalfBalls { HalfBall half_balls[]; };
// Faces of the cells along x, then along y, then along z.
layout(std430, binding = EDGE_BINDING) readonly buffer Edges { float edges[]; };
// Where part p of block b starts in its lights: positions[b * parts + p], and one more entry at the end.
layout(std430, binding = PARENT_POSITION_BINDING) readonly buffer ParentPositions { uint parent_positions[]; };
layout(std430, binding = PARENT_LIGHT_BINDING) readonly buffer ParentLights { uint parent_lights[]; };
layout(std430, binding = POSITION_BINDING) buffer Positions { uint positions[]; };
#if FILL
layout(std430, binding = LIGHT_BINDING) writeonly buffer Lights { uint lights[]; };
#endif

uniform uint cells_per_axis;
uniform uint side; // cells along a block
uniform uint blocks_per_axis;
uniform uint parents_per_axis;
uniform uint parent_parts;
uniform uint parts;
uniform uint first; // invocations of this run: indices into `positions`
uniform uint end;
uniform uint first_light; // position of the first light that this run writes

uint index_of(uvec3 place, uint per_axis) {
    return (place.z * per_axis + place.y) * per_axis + place.x;
}

vec3 corner_at(uvec3 cell) {
    uint faces = cells_per_axis + 1u;
    uvec3 face = min(cell, uvec3(cells_per_axis));
    return vec3(edges[face.x], edges[faces + face.y], edges[2u * faces + face.z]);
}

bool reaches(HalfBall half_ball, vec3 low, vec3 high) {
#if EXACT
    return half_ball_overlaps(half_ball, low, high);
#else
    precise vec3 relative_low = low - half_ball.centre;
    precise vec3 relative_high = high - half_ball.centre;
    return may_overlap(half_ball, relative_low, relative_high);
#endif
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = first + group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index >= end) {
        return;
    }
    uint block = index / parts;
    uvec3 place = uvec3(block, block / blocks_per_axis, block / (blocks_per_axis * blocks_per_axis)) % blocks_per_axis;
    vec3 low = corner_at(place * side), high = corner_at((place + 1u) * side);

    uint parent = index_of(place / uint(BRANCHING), parents_per_axis);
    uint start = parent_positions[parent * parent_parts];
    uint stop = parent_positions[(parent + 1u) * parent_parts];
    uint share = (stop - start + parts - 1u) / parts;
    start = min(start + (index % parts) * share, stop);
    stop = min(start + share, stop);

    uint count = 0u;
    for (uint i = start; i < stop; ++i) {
        uint light = parent_lights[i];
        if (reaches(half_balls[light], low, high)) {
#if FILL
            lights[positions[index] - first_light + count] = light;
#endif
            ++count;
        }
    }
#if !FILL
    positions[index] = count;
#endif
}
