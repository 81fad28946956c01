// SPDX-License-Identifier: GPL-3.0-or-later
// The voxels that triangles meet, into the masks of bricks. One invocation for a brick and a triangle: the document's
// voxel fragments (seed 004, 4.3.1), 64 at a time.
#include "passes/voxelize_blocks.glsl"
#include "passes/voxelize_rank.glsl"

layout(std430, binding = OCTREE_BINDING) buffer Octree { uint octree[]; };

uniform float growth;
uniform uint first_brick; // first word of the bricks in the octree

void main() {
    uint index = block_index();
    if (index >= block_count) {
        return;
    }
    uvec2 block = blocks[index];
    uvec3 brick = unpacked_cell(block.x);
    VoxelTriangle triangle = triangle_at(block.y);
    uint mask[2] = uint[2](0u, 0u);
    for (uint left = cells_that_meet(triangle, 2u * brick, 2.0, growth); left != 0u; left &= left - 1u) {
        uint i = uint(findLSB(left));
        uvec3 first = 4u * brick + 2u * uvec3(i & 1u, i >> 1 & 1u, i >> 2);
        mask[i / 4u] |= cells_that_meet(triangle, first, 1.0, growth) << (8u * (i % 4u));
    }
    uint place = first_brick + 2u * brick_number(brick);
    atomicOr(octree[place], mask[0]);
    atomicOr(octree[place + 1u], mask[1]);
}
