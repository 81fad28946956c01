// SPDX-License-Identifier: GPL-3.0-or-later
// How many voxels each brick has.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = OCTREE_BINDING) readonly buffer Octree { uint octree[]; };
layout(std430, binding = VOXEL_BINDING) writeonly buffer Voxels { uint voxels[]; };

uniform uint first_brick; // first word of the bricks in the octree
uniform uint brick_count;

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index < brick_count) {
        uint word = first_brick + 2u * index;
        voxels[index] = uint(bitCount(octree[word]) + bitCount(octree[word + 1u]));
    }
}
