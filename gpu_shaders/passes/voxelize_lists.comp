// SPDX-License-Identifier: GPL-3.0-or-later
// The triangles of each voxel. One invocation for a pair of a brick and a triangle: first it counts, then, when the counts
// have become the lists' beginnings (FILL), it takes the next place in the list of each voxel that the triangle meets.
#include "passes/voxelize_blocks.glsl"
#include "passes/voxelize_rank.glsl"

// The voxels of the brick that the triangle meets.
layout(std430, binding = MEETING_BINDING) readonly buffer Masks { uvec2 masks[]; };
layout(std430, binding = OCTREE_BINDING) readonly buffer Octree { uint octree[]; };
layout(std430, binding = VOXEL_BINDING) readonly buffer Voxels { uint voxels_before[]; };
layout(std430, binding = COUNT_BINDING) buffer Counts { uint counts[]; };
layout(std430, binding = LIST_BINDING) writeonly buffer Lists { uint lists[]; };

uniform uint first_brick; // first word of the bricks in the octree
uniform uint first_list; // first word of all lists

void main() {
    uint index = block_index();
    if (index >= block_count) {
        return;
    }
    uvec2 block = blocks[index];
    uint number = brick_number(unpacked_cell(block.x));
    uvec2 mask = masks[index];
    uint voxel = voxels_before[number];
    for (uint i = 0u; i < 2u; ++i) {
        uint occupied = octree[first_brick + 2u * number + i];
        for (uint left = mask[i]; left != 0u; left &= left - 1u) {
            uint bit = uint(findLSB(left));
            uint before = uint(bitCount(occupied & ((1u << bit) - 1u)));
            uint place = atomicAdd(counts[voxel + before], 1u);
#if FILL
            lists[first_list + place] = block.y;
#endif
        }
        voxel += uint(bitCount(occupied));
    }
}
