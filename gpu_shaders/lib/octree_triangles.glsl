// SPDX-License-Identifier: GPL-3.0-or-later
// Exact visibility and first hits: the walk of lib/octree.glsl, but an occupied voxel has its triangles asked.
//
// Whoever includes this binds the octree's buffer to OCTREE_BINDING and the triangles of its voxels to
// OCTREE_TRIANGLE_BINDING. A voxel's triangles are asked for the whole way, so no rounding of where a hit lies decides
// whether it is found. What small lengths there are come from core/brick_triangles.py, in steps of the lattice.
//
// Loops on software renderers (see lib/octree.glsl) also count each triangle that is asked. A way that is cut off counts
// as blocked; a first hit that is cut off is the nearest one until then.
#ifndef LIB_OCTREE_TRIANGLES
#define LIB_OCTREE_TRIANGLES

#include "lib/octree.glsl"

layout(std430, binding = OCTREE_TRIANGLE_BINDING) readonly buffer OctreeTriangles { uint octree_triangle_words[]; };

// More than any fraction of a way: it meets nothing.
#define OCTREE_NO_CROSSING 2.0
#define OCTREE_NO_TRIANGLE 0xFFFFFFFFu

// A way from start to start + along as triangles see it. axis: its longest one; slope: of the others along that.
struct OctreeRay {
    vec3 start;
    vec3 along;
    int axis;
    vec2 slope;
};

// normal: counter-clockwise, of twice the area.
struct OctreeTriangle {
    vec3 a;
    vec3 b;
    vec3 c;
    vec3 normal;
};

// Where a way first meets a triangle: the fraction of the way, the triangle's tree and number in there.
struct OctreeCrossing {
    float fraction;
    uint tree;
    uint triangle;
};

// normal: unit, geometric, of the counter-clockwise side. reflectance: diffuse; none where the surface is met from_back.
// distance: in voxels, from the place the way was asked for.
struct OctreeHit {
    bool found;
    vec3 place;
    vec3 normal;
    vec3 reflectance;
    bool from_back;
    float distance;
};

// The same vector with the component of `axis` last.
vec3 octree_turned(vec3 vector, int axis) {
    return axis == 0 ? vector.yzx : (axis == 1 ? vector.zxy : vector);
}

OctreeRay octree_ray(vec3 start, vec3 end) {
    vec3 along = end - start, size = abs(along);
    int axis = size.x >= max(size.y, size.z) ? 0 : (size.y >= size.z ? 1 : 2);
    vec3 turned = octree_turned(along, axis);
    return OctreeRay(start, along, axis, turned.xy / turned.z);
}

vec3 octree_triangle_vector(uint word) {
    return uintBitsToFloat(
        uvec3(octree_triangle_words[word], octree_triangle_words[word + 1u], octree_triangle_words[word + 2u])
    );
}

// First word of a triangle.
uint octree_triangle_word(uint tree, uint triangle) {
    return octree_triangle_words[4u * tree + 3u] + 16u * triangle;
}

OctreeTriangle octree_triangle(uint word) {
    uvec3 normal = uvec3(
        octree_triangle_words[word + 3u], octree_triangle_words[word + 7u], octree_triangle_words[word + 11u]
    );
    return OctreeTriangle(
        octree_triangle_vector(word), octree_triangle_vector(word + 4u), octree_triangle_vector(word + 8u),
        uintBitsToFloat(normal)
    );
}

// The fraction of a way at which it meets a triangle, else OCTREE_NO_CROSSING. slack: how far outside the triangle's
// edges, across the way's longest axis, it still does.
float octree_crossing(OctreeRay ray, OctreeTriangle triangle, float slack) {
    vec3 a = triangle.a - ray.start;
    // Heights over the plane, each from differences of its own: their signs are right wherever an end is lifted.
    float before = -dot(triangle.normal, a), after = dot(triangle.normal, ray.along - a);
    if ((before > 0.0) == (after > 0.0)) {
        return OCTREE_NO_CROSSING;
    }
    // Corners seen along the way, which is at the origin (Woop, Benthin and Wald 2013).
    vec3 corner_a = octree_turned(a, ray.axis);
    vec3 corner_b = octree_turned(triangle.b - ray.start, ray.axis);
    vec3 corner_c = octree_turned(triangle.c - ray.start, ray.axis);
    vec2 seen_a = corner_a.xy - ray.slope * corner_a.z;
    vec2 seen_b = corner_b.xy - ray.slope * corner_b.z;
    vec2 seen_c = corner_c.xy - ray.slope * corner_c.z;
    vec2 ab = seen_b - seen_a, bc = seen_c - seen_b, ca = seen_a - seen_c;
    vec3 side = vec3(
        ab.y * seen_a.x - ab.x * seen_a.y, bc.y * seen_b.x - bc.x * seen_b.y, ca.y * seen_c.x - ca.x * seen_c.y
    );
    vec3 most = slack * vec3(abs(ab.x) + abs(ab.y), abs(bc.x) + abs(bc.y), abs(ca.x) + abs(ca.y));
    bool within = all(greaterThanEqual(side, -most)) || all(lessThanEqual(side, most));
    return within ? before / (before - after) : OCTREE_NO_CROSSING;
}

// How far outside its edges a triangle is met, and how far over their planes ways begin and end: both in voxels.
float octree_edge_slack() {
    return OCTREE_EDGE_SHARE * float(1u << octree_words[1]);
}

float octree_lift() {
    return OCTREE_LIFT_SHARE * float(1u << octree_words[1]);
}

// Words from the first triangle of an occupied voxel's list to behind its last.
uvec2 octree_list(uint tree, uint brick, ivec3 cell) {
    uint word = octree_words[3u + 2u * tree] + 2u * brick;
    uint bit = 8u * octree_octant(cell, 1u) + octree_octant(cell, 0u);
    uint below = (1u << (bit % 32u)) - 1u;
    uint before = uint(
        bit < 32u ? bitCount(octree_words[word] & below)
        : bitCount(octree_words[word]) + bitCount(octree_words[word + 1u] & below)
    );
    uint voxel = octree_triangle_words[octree_triangle_words[4u * tree] + brick] + before;
    uint start = octree_triangle_words[4u * tree + 1u] + voxel;
    return octree_triangle_words[4u * tree + 2u] + uvec2(octree_triangle_words[start], octree_triangle_words[start + 1u]);
}

// Whether a way meets a triangle of a list. asked: the triangle that was asked last, often that of the next voxel too.
bool octree_list_blocks(uint tree, uvec2 list, OctreeRay ray, float slack, inout uint asked) {
    uint i = list.x;
    for (; i < list.y; ++i) {
        uint triangle = octree_triangle_words[i];
        if (triangle != asked) {
            asked = triangle;
            if (octree_crossing(ray, octree_triangle(octree_triangle_word(tree, triangle)), slack) <= 1.0) {
                return true;
            }
        }
    }
    // Not all of them if the loop was cut off.
    return i < list.y;
}

// Whether no triangle of one tree is on the way between two points.
bool octree_tree_open(uint tree, vec3 start, vec3 end) {
    OctreeWalk walk = octree_walk(start, end);
    OctreeRay ray = octree_ray(start, end);
    float slack = octree_edge_slack();
    uint asked = OCTREE_NO_TRIANGLE;
    while (!walk.ended && walk.steps > 0) {
        VoxelBox box = octree_next(tree, walk);
        if (box.occupied) {
            if (octree_list_blocks(tree, octree_list(tree, box.brick, walk.cell), ray, slack, asked)) {
                return false;
            }
            octree_leave(walk, box.low, box.high);
        }
    }
    return walk.ended;
}

// Whether no triangle is on the way between two points in voxel coordinates.
bool octree_open(vec3 start, vec3 end) {
    for (uint tree = 0u; tree < octree_words[0]; ++tree) {
        if (!octree_tree_open(tree, start, end)) {
            return false;
        }
    }
    return true;
}

// Whether two surface points in voxel coordinates see each other. Normals: unit, geometric, on the side of the way.
// exact_reach: so many voxels of the way at either end, along its longest axis, are asked for triangles; in between it
// goes where octree_surfaces_see goes and every occupied voxel blocks. Four short ways join the two, so none leads
// through a closed surface. 0: octree_surfaces_see. OCTREE_ALL_EXACT: triangles everywhere. True where points are nearer
// to each other than they are lifted.
bool octree_points_see(vec3 place, vec3 normal, vec3 other_place, vec3 other_normal, int exact_reach) {
    if (exact_reach <= 0) {
        return octree_surfaces_see(place, normal, other_place, other_normal);
    }
    float lift = octree_lift();
    vec3 start = octree_lifted_by(lift, place, normal, lift, other_place, other_normal);
    vec3 end = octree_lifted_by(lift, other_place, other_normal, lift, place, normal);
    vec3 way = other_place - place, size = abs(end - start);
    if (dot(end - start, way) <= 0.0) {
        return true;
    }
    vec3 high_start = octree_lifted(place, normal, other_place, other_normal);
    vec3 high_end = octree_lifted(other_place, other_normal, place, normal);
    float share = float(exact_reach) / max(size.x, max(size.y, size.z));
    if (share >= 0.5 || dot(high_end - high_start, way) <= 0.0) {
        return octree_open(start, end);
    }
    vec3 leaving = mix(start, end, share), arriving = mix(end, start, share);
    vec3 high_leaving = mix(high_start, high_end, share), high_arriving = mix(high_end, high_start, share);
    return octree_clear(high_leaving, high_arriving) && octree_open(start, leaving) && octree_open(arriving, end)
        && octree_open(leaving, high_leaving) && octree_open(high_arriving, arriving);
}

// The nearest of `found` and what a way meets in a list; of two as near, the triangle of the smaller number.
OctreeCrossing octree_list_nearest(uint tree, uvec2 list, OctreeRay ray, float slack, OctreeCrossing found) {
    for (uint i = list.x; i < list.y; ++i) {
        uint triangle = octree_triangle_words[i];
        float fraction = octree_crossing(ray, octree_triangle(octree_triangle_word(tree, triangle)), slack);
        bool is_first = found.tree == tree && triangle < found.triangle;
        if (fraction <= 1.0 && (fraction < found.fraction || (fraction == found.fraction && is_first))) {
            found = OctreeCrossing(fraction, tree, triangle);
        }
    }
    return found;
}

// The nearest of `found` and what a way meets in one tree. A crossing may lie beyond the voxel in which it was found; the
// walk ends where it has come past it.
OctreeCrossing octree_tree_nearest(uint tree, vec3 start, vec3 end, OctreeCrossing found) {
    OctreeWalk walk = octree_walk(start, end);
    OctreeRay ray = octree_ray(start, end);
    float slack = octree_edge_slack();
    while (!walk.ended && walk.steps > 0 && walk.fraction <= found.fraction) {
        VoxelBox box = octree_next(tree, walk);
        if (box.occupied) {
            found = octree_list_nearest(tree, octree_list(tree, box.brick, walk.cell), ray, slack, found);
            octree_leave(walk, box.low, box.high);
        }
    }
    return found;
}

// How far along a unit direction a point inside the voxels is from a voxel beyond their end.
float octree_exit(vec3 start, vec3 direction) {
    vec3 end = mix(vec3(0.0), vec3(float(1u << octree_words[1])), greaterThan(direction, vec3(0.0)));
    vec3 lengths = mix((end - start) / direction, vec3(OCTREE_FAR), equal(direction, vec3(0.0)));
    return max(min(lengths.x, min(lengths.y, lengths.z)), 0.0) + 1.0;
}

// The first triangle along a way from a surface point in voxel coordinates. normal: unit, geometric, on the side of the
// way, or zero for a point in space; direction: unit.
OctreeHit octree_first_hit(vec3 place, vec3 normal, vec3 direction) {
    vec3 start = place + normal * octree_lift();
    vec3 end = start + direction * octree_exit(start, direction);
    OctreeCrossing found = OctreeCrossing(OCTREE_NO_CROSSING, 0u, 0u);
    for (uint tree = 0u; tree < octree_words[0]; ++tree) {
        found = octree_tree_nearest(tree, start, end, found);
    }
    if (found.fraction > 1.0) {
        return OctreeHit(false, end, vec3(0.0), vec3(0.0), false, distance(place, end));
    }
    uint word = octree_triangle_word(found.tree, found.triangle);
    vec3 hit_place = mix(start, end, found.fraction), hit_normal = normalize(octree_triangle(word).normal);
    bool from_back = dot(hit_normal, direction) > 0.0;
    vec3 reflectance = from_back ? vec3(0.0) : octree_triangle_vector(word + 12u);
    return OctreeHit(true, hit_place, hit_normal, reflectance, from_back, distance(place, hit_place));
}

#endif
