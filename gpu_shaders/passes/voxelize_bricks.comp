// SPDX-License-Identifier: GPL-3.0-or-later
// The voxels that triangles meet, into the masks of bricks. One invocation for a brick and a triangle: the document's
// voxel fragments (seed 004, 4.3.1), 64 at a time. KEEP: each invocation's mask is kept for voxelize_lists.comp.
#include "passes/voxelize_blocks.glsl"
#include "passes/voxelize_rank.glsl"

layout(std430, binding = OCTREE_BINDING) buffer Octree { uint octree[]; };

#if KEEP
layout(std430, binding = MEETING_BINDING) writeonly buffer Masks { uvec2 masks[]; };
#endif

uniform float growth;
uniform uint first_brick; // first word of the bricks in the octree

// Bits of the voxels of a brick that a triangle meets: 8 times the octant of 2 x 2 x 2 voxels plus its own in there.
uvec2 voxels_that_meet(VoxelTriangle triangle, uvec3 brick, float growth) {
    uvec2 mask = uvec2(0u);
    for (uint left = cells_that_meet(triangle, 2u * brick, 2.0, growth); left != 0u; left &= left - 1u) {
        uint i = uint(findLSB(left));
        uvec3 first = 4u * brick + 2u * uvec3(i & 1u, i >> 1 & 1u, i >> 2);
        mask[i / 4u] |= cells_that_meet(triangle, first, 1.0, growth) << (8u * (i % 4u));
    }
    return mask;
}

void main() {
    uint index = block_index();
    if (index >= block_count) {
        return;
    }
    uvec2 block = blocks[index];
    uvec3 brick = unpacked_cell(block.x);
    uvec2 mask = voxels_that_meet(triangle_at(block.y), brick, growth);
#if KEEP
    masks[index] = mask;
#endif
    uint place = first_brick + 2u * brick_number(brick);
    atomicOr(octree[place], mask.x);
    atomicOr(octree[place + 1u], mask.y);
}
