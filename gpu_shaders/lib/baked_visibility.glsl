// SPDX-License-Identifier: GPL-3.0-or-later
// Visibility that was baked for pieces of surface, as core/baked_visibility.py has it: how much a row of it counts at a
// point, and how a point keeps its rows.
#ifndef LIB_BAKED_VISIBILITY
#define LIB_BAKED_VISIBILITY

// The row's number of shares, which of its block's cells it is in, and which way it faces.
uint baked_row(uint entry) {
    return entry >> 6;
}

// Share of what a row counts that comes from its cell. fraction: where between the middles of its cells the point is in
// the block.
float baked_nearness(uint entry, vec3 fraction) {
    bvec3 is_upper = notEqual(uvec3(entry) >> uvec3(3u, 4u, 5u) & 1u, uvec3(0u));
    vec3 along = mix(1.0 - fraction, fraction, is_upper);
    return along.x * along.y * along.z;
}

// And from the way it faces: squares of a unit normal's components (the ambient cube). way: 2 axis + 1 for the negative
// one.
float baked_facing(uint entry, vec3 normal) {
    uint way = entry & 7u;
    float along = max((way & 1u) == 0u ? normal[way >> 1] : -normal[way >> 1], 0.0);
    return along * along;
}

// A row and its weight in [0, 1] in one word; 0 for a weight too small.
uint packed_baked_row(uint row, float weight) {
    uint steps = uint(weight * float(BAKED_WEIGHT_STEPS) + 0.5);
    return steps == 0u ? 0u : row << BAKED_WEIGHT_BITS | steps;
}

uvec4 rows_of_packed(uvec4 words) {
    return words >> BAKED_WEIGHT_BITS;
}

// In steps, exact.
vec4 weights_of_packed(uvec4 words) {
    return vec4(words & BAKED_WEIGHT_STEPS);
}

// The bytes of words that belong to a light, 0 to 255.
vec4 bytes_of_words(uvec4 words, uint light) {
    return vec4(words >> 8u * (light & 3u) & 255u);
}

// Whether points of two surfaces are over each other's planes. way: from the first to the second, in voxels, which float32
// knows to some 1e-5; normals are unit.
bool surfaces_face(vec3 way, vec3 normal, vec3 other_normal) {
    float least = BAKED_GRAZING * max(length(way), 1.0);
    return dot(way, normal) > least && dot(way, other_normal) < -least;
}

// Which of a light's samples a row's point looks at: all of them are looked at by some row, and points that follow each
// other look at samples far apart.
uint baked_sample(uint row, uint point, uint count) {
    uint high, low;
    umulExtended(point * BAKED_POINT_STEP + row * BAKED_ROW_STEP, count, high, low);
    return high;
}
#endif
