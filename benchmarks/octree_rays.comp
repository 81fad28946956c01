// SPDX-License-Identifier: GPL-3.0-or-later
// Whether pairs of surface points see each other through the octree: what many lights ask for; or FIRST_HIT: where ways
// from the first points first meet a triangle.
#include "lib/octree_triangles.glsl"

layout(local_size_x = GROUP_SIZE) in;

// Place and normal of one point, then of the other, in voxels; the third is a direction for FIRST_HIT.
layout(std430, binding = PAIR_BINDING) readonly buffer Pairs { vec4 pairs[]; };
layout(std430, binding = RESULT_BINDING) writeonly buffer Results { vec4 results[]; };

uniform uint count;

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index >= count) {
        return;
    }
    uint first = 4u * index;
    vec3 place = pairs[first].xyz, normal = pairs[first + 1u].xyz, other = pairs[first + 2u].xyz;
#if FIRST_HIT
    OctreeHit hit = octree_first_hit(place, normal, other);
    results[index] = vec4(hit.place, float(hit.found));
#else
    results[index] = vec4(octree_points_see(place, normal, other, pairs[first + 3u].xyz, REACH));
#endif
}
