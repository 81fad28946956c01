// SPDX-License-Identifier: GPL-3.0-or-later
// Whether the place over a surface point whose zone the point is to be in can be reached from it: a ceiling that has a
// lamp's panel close below it is not part of what is under the panel.
#include "lib/octree_triangles.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = PLACE_BINDING) readonly buffer Places { vec4 places[]; };     // voxel coordinates
layout(std430, binding = NORMAL_BINDING) readonly buffer Normals { vec4 normals[]; };  // unit, geometric
layout(std430, binding = OPEN_BINDING) writeonly buffer Opens { uint opens[]; };

uniform uint count;

void main() {
    uint index = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index < count) {
        vec3 place = places[index].xyz, normal = normals[index].xyz;
        vec3 over = place + normal * octree_reach(normal);
        opens[index] = octree_points_see(place, normal, over, vec3(0.0), OCTREE_ALL_EXACT) ? 1u : 0u;
    }
}
