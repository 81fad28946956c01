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
    uvec2 mask = voxels_that_meet(triangle_at(block.y), brick, growth);
    uint place = first_brick + 2u * brick_number(brick);
    atomicOr(octree[place], mask.x);
    atomicOr(octree[place + 1u], mask.y);
}
