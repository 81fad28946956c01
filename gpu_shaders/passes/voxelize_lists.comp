// SPDX-License-Identifier: GPL-3.0-or-later
// The triangles of each brick. One invocation for a pair of a brick and a triangle: first it takes a place in the
// brick's list, kept in `meetings`, then, when the counts have become the lists' beginnings (FILL), it writes the triangle there.
#include "passes/voxelize_blocks.glsl"
#include "passes/voxelize_rank.glsl"

layout(std430, binding = COUNT_BINDING) buffer Counts { uint counts[]; };
layout(std430, binding = LIST_BINDING) writeonly buffer Lists { uint lists[]; };

uniform uint first_list; // first word of all lists

void main() {
    uint index = block_index();
    if (index >= block_count) {
        return;
    }
    uvec2 block = blocks[index];
    uint brick = brick_number(unpacked_cell(block.x));
#if FILL
    lists[first_list + counts[brick] + meetings[index]] = block.y;
#else
    meetings[index] = atomicAdd(counts[brick], 1u);
#endif
}
