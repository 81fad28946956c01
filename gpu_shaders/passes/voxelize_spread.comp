// SPDX-License-Identifier: GPL-3.0-or-later
// The blocks of the next level from the cells that triangles meet, in any order: what is made of them has no order.
// `total` counts what has been written. LAST: the cells themselves, which are bricks.
#include "passes/voxelize_meetings.glsl"

layout(std430, binding = NEXT_BINDING) writeonly buffer Next { uvec2 next[]; };

shared uint group_start;

void main() {
    if (gl_LocalInvocationID.x == 0u) {
        group_total = 0u;
    }
    barrier();
    uint index = block_index();
    uint mask = index < block_count ? meetings[index] : 0u;
    uint place = mask != 0u ? atomicAdd(group_total, uint(bitCount(mask))) : 0u;
    barrier();
    if (gl_LocalInvocationID.x == 0u) {
        group_start = group_total != 0u ? atomicAdd(total, group_total) : 0u;
    }
    barrier();
    if (mask == 0u) {
        return;
    }
    uvec2 block = blocks[index];
    uvec3 first = unpacked_cell(block.x);
    for (uint left = mask; left != 0u; left &= left - 1u) {
        uint i = uint(findLSB(left));
        uvec3 cell = first + uvec3(i & 1u, i >> 1 & 1u, i >> 2);
#if !LAST
        cell *= 2u;
#endif
        next[group_start + place] = uvec2(packed_cell(cell), block.y);
        ++place;
    }
}
