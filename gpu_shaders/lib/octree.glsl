// SPDX-License-Identifier: GPL-3.0-or-later
// Visibility through a sparse voxel octree: the walk of core/octree_march.py in float32, and where it begins and ends.
//
// Whoever includes this binds the octree's buffer to OCTREE_BINDING. The walk's state is a voxel, three integers. Each
// step leaves the largest empty cube around it through one face, towards the last voxel and never past it along any
// axis: at most as many steps as voxels along the three axes. Rounding may only change the order in which faces are
// crossed, and no such way leads through a closed surface past all voxels that the surface meets.
//
// Software renderers end all loops of an invocation after 65,535 rounds together. A step takes as many as the tree has
// levels, so whoever asks for many ways in one invocation asks for some dozens at a time; a way that is cut off counts
// as blocked.
#ifndef LIB_OCTREE
#define LIB_OCTREE

layout(std430, binding = OCTREE_BINDING) readonly buffer Octree { uint octree_words[]; };

// low, high: first and last voxel of the largest cube that holds a voxel and is empty, or one voxel that is occupied;
// brick: the number of its brick where it is occupied.
struct VoxelBox {
    ivec3 low;
    ivec3 high;
    bool occupied;
    uint brick;
};

// A way through voxels. cell: where it is; last: where it ends; fraction: of the way, about where it came into `cell`;
// steps: how many it may take yet; ended: whether nothing is left of it, which a walk that is cut off never says.
struct OctreeWalk {
    vec3 start;
    vec3 along;
    ivec3 cell;
    ivec3 last;
    float fraction;
    int steps;
    bool ended;
};

// Voxel coordinates of a position. frame: the octree's lower corner, and voxels for each unit of length.
vec3 octree_place(vec3 position, vec4 frame) {
    return (position - frame.xyz) * frame.w;
}

ivec3 octree_cell(vec3 place) {
    return ivec3(floor(clamp(place, vec3(-OCTREE_FAR), vec3(OCTREE_FAR))));
}

// The octant of the node of 2 << height voxels that holds a cell.
uint octree_octant(ivec3 cell, uint height) {
    uvec3 bits = uvec3(cell) >> height & 1u;
    return bits.x | bits.y << 1 | bits.z << 2;
}

// The half space beside the cube of `size` voxels that holds a cell outside of it, or a quarter or an eighth of space.
VoxelBox octree_outside(ivec3 cell, int size) {
    ivec3 below = ivec3(lessThan(cell, ivec3(0))), above = ivec3(greaterThanEqual(cell, ivec3(size)));
    ivec3 low = above * size - (1 - above) * (4 * OCTREE_FAR);
    ivec3 high = (1 - below) * (4 * OCTREE_FAR) - below;
    return VoxelBox(low, high, false, 0u);
}

// What one of the trees in the buffer knows around a voxel.
VoxelBox octree_box(uint tree, ivec3 cell) {
    uint height = octree_words[1];
    int size = 1 << height;
    if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, ivec3(size)))) {
        return octree_outside(cell, size);
    }
    uint first_node = octree_words[2u + 2u * tree], first_brick = octree_words[3u + 2u * tree];
    uint node = 0u;
    bool found = true;
    while (found && height > 2u) {
        --height;
        uint octant = octree_octant(cell, height);
        uint word = octree_words[first_node + node];
        found = (word >> octant & 1u) != 0u;
        node = (word >> 8) + uint(bitCount(word & ((1u << octant) - 1u)));
    }
    if (found) {
        uint pair = octree_octant(cell, 1u);
        uint voxels = octree_words[first_brick + 2u * node + pair / 4u] >> (8u * (pair % 4u)) & 255u;
        found = (voxels >> octree_octant(cell, 0u) & 1u) != 0u;
        height = voxels == 0u ? 1u : 0u;
    }
    int side = 1 << height;
    ivec3 low = cell & -side;
    return VoxelBox(low, low + (side - 1), found, node);
}

// From start to end, with as many steps as no walk exceeds.
OctreeWalk octree_walk(vec3 start, vec3 end) {
    int most_steps = 3 * (1 << octree_words[1]) + 8;
    return OctreeWalk(start, end - start, octree_cell(start), octree_cell(end), 0.0, most_steps, false);
}

// Moves a walk out of the cube of voxels from `low` to `high` that holds its cell, unless it ends in there.
void octree_leave(inout OctreeWalk walk, ivec3 low, ivec3 high) {
    ivec3 way = sign(walk.last - walk.cell), ahead = max(way, 0);
    ivec3 far = ahead * high + (1 - ahead) * low;
    bvec3 leaves = greaterThan((walk.last - far) * way, ivec3(0));
    if (!any(leaves)) {
        walk.ended = true;
        return;
    }
    vec3 fractions = mix(vec3(2.0), (vec3(far + ahead) - walk.start) / walk.along, leaves);
    float least = min(fractions.x, min(fractions.y, fractions.z));
    // Not back, not out of the cube but where it is left, and not past the last voxel.
    ivec3 limit = ahead * min(far, walk.last) + (1 - ahead) * max(far, walk.last);
    ivec3 moved = octree_cell(walk.start + walk.along * least);
    ivec3 next = clamp(moved, min(walk.cell, limit), max(walk.cell, limit));
    int axis = fractions.x == least ? 0 : (fractions.y == least ? 1 : 2);
    next[axis] = far[axis] + way[axis];
    walk.cell = next;
    walk.fraction = least;
    --walk.steps;
}

// Moves a walk to the next occupied voxel of a tree, its own included, and returns its box; or a box that is not occupied
// where there is none up to its end.
VoxelBox octree_next(uint tree, inout OctreeWalk walk) {
    VoxelBox box = octree_box(tree, walk.cell);
    while (!box.occupied && !walk.ended && walk.steps > 0) {
        octree_leave(walk, box.low, box.high);
        box = octree_box(tree, walk.cell);
    }
    return box;
}

// Whether one tree has no occupied voxel between two points in voxel coordinates, the points' own voxels included.
bool octree_tree_clear(uint tree, vec3 start, vec3 end) {
    OctreeWalk walk = octree_walk(start, end);
    return !octree_next(tree, walk).occupied && walk.ended;
}

// Whether no tree has an occupied voxel between two points in voxel coordinates, the points' own voxels included.
bool octree_clear(vec3 start, vec3 end) {
    for (uint tree = 0u; tree < octree_words[0]; ++tree) {
        if (!octree_tree_clear(tree, start, end)) {
            return false;
        }
    }
    return true;
}

// How many voxels along its unit normal a point has to be over a plane for its own voxel not to touch the plane: the
// extent of a voxel along the normal. 0 for no normal.
float octree_reach(vec3 normal) {
    return (abs(normal.x) + abs(normal.y) + abs(normal.z)) * (1.0 + OCTREE_SLACK);
}

// Where a way from a surface point to another begins, in voxel coordinates: over its own plane by `reach` and over the
// other's by `other_reach`. Normals are unit and geometric, or zero for a point in space.
vec3 octree_lifted_by(
    float reach, vec3 place, vec3 normal, float other_reach, vec3 other_place, vec3 other_normal
) {
    vec3 lifted = place + normal * reach;
    float missing = other_reach - dot(other_normal, lifted - other_place);
    if (missing <= 0.0) {
        return lifted;
    }
    // Along the other normal, but not back towards the own plane. Planes that face each other have no such way: the
    // lift is at most twice what is missing.
    float facing = min(dot(normal, other_normal), 0.0);
    return lifted + (other_normal - facing * normal) * (missing / max(1.0 - facing * facing, 0.25));
}

// Where a way through voxels alone begins: so high that neither surface's voxels stand in the way, nor floor and wall
// where they meet.
vec3 octree_lifted(vec3 place, vec3 normal, vec3 other_place, vec3 other_normal) {
    return octree_lifted_by(octree_reach(normal), place, normal, octree_reach(other_normal), other_place, other_normal);
}

// Whether two surface points in voxel coordinates see each other. True where they are too near for voxels to tell.
bool octree_surfaces_see(vec3 place, vec3 normal, vec3 other_place, vec3 other_normal) {
    vec3 start = octree_lifted(place, normal, other_place, other_normal);
    vec3 end = octree_lifted(other_place, other_normal, place, normal);
    return dot(end - start, other_place - place) <= 0.0 || octree_clear(start, end);
}

#endif
