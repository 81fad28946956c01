// SPDX-License-Identifier: GPL-3.0-or-later
// Whether pairs of surface points see each other through the octree: what many lights ask for.
#include "lib/octree.glsl"

layout(local_size_x = GROUP_SIZE) in;

// Place and normal of one point, then of the other, in voxels.
layout(std430, binding = PAIR_BINDING) readonly buffer Pairs { vec4 pairs[]; };
layout(std430, binding = RESULT_BINDING) writeonly buffer Results { uint results[]; };

uniform uint count;

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index >= count) {
        return;
    }
    uint first = 4u * index;
    bool seen = octree_surfaces_see(
        pairs[first].xyz, pairs[first + 1u].xyz, pairs[first + 2u].xyz, pairs[first + 3u].xyz
    );
    results[index] = uint(seen);
}
