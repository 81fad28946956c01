// SPDX-License-Identifier: GPL-3.0-or-later
// Which share of a virtual light the surface of a row sees: ways between points of the row and samples of the light's
// source surface that face each other, and how many of them nothing blocks. An invocation is one row and one light.
#include "lib/octree_triangles.glsl"
#include "lib/baked_visibility.glsl"

layout(local_size_x = GROUP_SIZE) in;

// In voxel coordinates; normals are unit and geometric. w is unused.
struct Facet {
    vec4 place;
    vec4 normal;
};

layout(std430, binding = ROW_POINT_BINDING) readonly buffer RowPoints { Facet row_points[]; };
layout(std430, binding = LIGHT_SAMPLE_BINDING) readonly buffer LightSamples { Facet light_samples[]; };
layout(std430, binding = SAMPLE_OFFSET_BINDING) readonly buffer SampleOffsets { uint sample_offsets[]; };
// A byte for each light, four in a word; 0 before.
layout(std430, binding = SHARE_BINDING) buffer Shares { uint shares[]; };

uniform uint points_per_row;
uniform uint light_count;
uniform uint words_per_row;
// A run of pairs of a row and a light.
uniform uint first_pair;
uniform uint end_pair;

// Most ways are clear of voxels between their ends: triangles are asked all along the others alone.
bool see(Facet from, Facet to) {
    vec3 place = from.place.xyz, normal = from.normal.xyz, other_place = to.place.xyz, other_normal = to.normal.xyz;
#if NEAR_REACH
    if (octree_points_see(place, normal, other_place, other_normal, NEAR_REACH)) {
        return true;
    }
#endif
    return octree_points_see(place, normal, other_place, other_normal, OCTREE_ALL_EXACT);
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint pair = first_pair + group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (pair >= end_pair) {
        return;
    }
    uint row = pair / light_count, light = pair % light_count;
    uint first = sample_offsets[light], count = sample_offsets[light + 1u] - first;
    uint facing = 0u, seen = 0u;
    for (uint i = 0u; i < points_per_row && count > 0u; ++i) {
        Facet from = row_points[row * points_per_row + i], to = light_samples[first + baked_sample(row, i, count)];
        vec3 way = to.place.xyz - from.place.xyz;
        if (surfaces_face(way, from.normal.xyz, to.normal.xyz)) {
            ++facing;
            seen += see(from, to) ? 1u : 0u;
        }
    }
    uint share = facing == 0u ? BAKED_UNFACED : (2u * BAKED_FULL * seen + facing) / (2u * facing);
    atomicOr(shares[row * words_per_row + light / 4u], share << 8u * (light & 3u));
}
