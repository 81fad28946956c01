// SPDX-License-Identifier: GPL-3.0-or-later
// Does a triangle meet a cube? By separating axes (Akenine-Moeller 2001), as core/triangle_box.py.
//
// Coordinates are in voxels and multiples of 2^(depth - 24), so that every difference of two of them is exact. Each of
// the sums below is then off by less than 2^(depth - 22) of what the cube's half side adds to it: with a `half` that is
// larger by this much no cube that the triangle meets is left out.
#ifndef LIB_TRIANGLE_BOX
#define LIB_TRIANGLE_BOX

// normal: across the edges, of any length, accurate in each component; zero where the triangle has no area.
struct VoxelTriangle {
    vec3 v0;
    vec3 v1;
    vec3 v2;
    vec3 normal;
};

// Whether the triangle's plane meets the cube around the origin.
bool plane_meets(vec3 normal, vec3 point, float half_side) {
    precise float height = normal.x * point.x + normal.y * point.y + normal.z * point.z;
    precise float reach = half_side * (abs(normal.x) + abs(normal.y) + abs(normal.z));
    return abs(height) <= reach;
}

// Whether the triangle's and the cube's shadows along z overlap along the axis across the edge from a to b; c: the
// third corner.
bool shadows_meet(vec2 a, vec2 b, vec2 c, float half_side) {
    vec2 edge = b - a;
    precise float on_edge = edge.x * a.y - edge.y * a.x;
    precise float opposite = edge.x * c.y - edge.y * c.x;
    precise float reach = half_side * (abs(edge.x) + abs(edge.y));
    return min(on_edge, opposite) <= reach && max(on_edge, opposite) >= -reach;
}

// The three axes that an edge makes with the coordinate axes.
bool edge_meets(vec3 a, vec3 b, vec3 c, float half_side) {
    return shadows_meet(a.xy, b.xy, c.xy, half_side) && shadows_meet(a.yz, b.yz, c.yz, half_side)
        && shadows_meet(a.zx, b.zx, c.zx, half_side);
}

bool triangle_meets_cube(VoxelTriangle triangle, vec3 centre, float half_side) {
    vec3 a = triangle.v0 - centre, b = triangle.v1 - centre, c = triangle.v2 - centre;
    vec3 low = min(a, min(b, c)), high = max(a, max(b, c));
    if (any(greaterThan(low, vec3(half_side))) || any(lessThan(high, vec3(-half_side)))) {
        return false;
    }
    return plane_meets(triangle.normal, a, half_side) && edge_meets(a, b, c, half_side)
        && edge_meets(b, c, a, half_side) && edge_meets(c, a, b, half_side);
}

// Bits of the cells of a block of 2 x 2 x 2, x + 2 y + 4 z, that a triangle meets. side: of a cell; first: lowest cell,
// in cells; growth: by how much each cell is larger on each side.
uint cells_that_meet(VoxelTriangle triangle, uvec3 first, float side, float growth) {
    uint mask = 0u;
    for (uint i = 0u; i < 8u; ++i) {
        uvec3 cell = first + uvec3(i & 1u, i >> 1 & 1u, i >> 2);
        if (triangle_meets_cube(triangle, (vec3(cell) + 0.5) * side, 0.5 * side + growth)) {
            mask |= 1u << i;
        }
    }
    return mask;
}

#endif
