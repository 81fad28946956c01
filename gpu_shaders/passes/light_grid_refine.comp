// SPDX-License-Identifier: GPL-3.0-or-later
// The lists of blocks of cells from the lists of the blocks of the next larger size that hold them (seed 002, 4.2).
// One invocation looks at one part of one list, in order, so the lists ascend however the device schedules it.
// FILL: write lights where the counts of an earlier run, summed up, say. MASKS: the smallest blocks, whose cells are
// looked at: lights that reach none of them are left out.
#include "gpu_layout/HalfBall"
#include "lib/active_hemisphere.glsl"
#include "lib/block_masks.glsl"

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
#if MASKS
layout(std430, binding = MASK_BINDING) writeonly buffer Masks { uvec2 masks[]; };
#endif
#endif

uniform uint cells_per_axis;
uniform uint side; // cells along a block
uniform uint blocks_per_axis;
uniform uint parents_per_axis;
uniform uint parent_parts;
uniform uint parts;
uniform uint first; // invocations of this run: indices into `positions`
uniform uint end;

uint index_of(uvec3 place, uint per_axis) {
    return (place.z * per_axis + place.y) * per_axis + place.x;
}

vec3 corner_at(uvec3 cell) {
    uint faces = cells_per_axis + 1u;
    uvec3 face = min(cell, uvec3(cells_per_axis));
    return vec3(edges[face.x], edges[faces + face.y], edges[2u * faces + face.z]);
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = first + group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index >= end) {
        return;
    }
    uint block = index / parts;
    uvec3 place = uvec3(block, block / blocks_per_axis, block / (blocks_per_axis * blocks_per_axis)) % blocks_per_axis;
#if MASKS
    uvec3 first_cell = place * side, last_cell = uvec3(cells_per_axis - 1u);
    vec4 low[3], high[3];
    for (uint i = 0u; i < 4u; ++i) {
        uvec3 cell = min(first_cell + i, last_cell);
        vec3 low_corner = corner_at(cell), high_corner = corner_at(cell + 1u);
        for (int axis = 0; axis < 3; ++axis) {
            low[axis][i] = low_corner[axis];
            high[axis][i] = high_corner[axis];
        }
    }
    uvec3 counts = min(last_cell + 1u - first_cell, uvec3(4u));
#else
    vec3 low = corner_at(place * side), high = corner_at((place + 1u) * side);
#endif

    uint parent = index_of(place / uint(BRANCHING), parents_per_axis);
    uint start = parent_positions[parent * parent_parts];
    uint stop = parent_positions[(parent + 1u) * parent_parts];
    uint share = (stop - start + parts - 1u) / parts;
    start = min(start + (index % parts) * share, stop);
    stop = min(start + share, stop);

    uint count = 0u;
    for (uint i = start; i < stop; ++i) {
        uint light = parent_lights[i];
        HalfBall half_ball = half_balls[light];
#if MASKS
        uvec2 mask = block_mask(half_ball, low, high, counts);
        bool reached = (mask.x | mask.y) != 0u;
#else
        precise vec3 relative_low = low - half_ball.centre;
        precise vec3 relative_high = high - half_ball.centre;
        bool reached = may_overlap(half_ball, relative_low, relative_high);
#endif
        if (reached) {
#if FILL
            lights[positions[index] + count] = light;
#if MASKS
            masks[positions[index] + count] = mask;
#endif
#endif
            ++count;
        }
    }
#if !FILL
    positions[index] = count;
#endif
}
