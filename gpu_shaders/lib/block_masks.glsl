// SPDX-License-Identifier: GPL-3.0-or-later
// Which of the 4 x 4 x 4 cells of a block a half ball reaches, as bits x + 4 y + 16 z of two words, lower bits first:
// half_ball_overlaps for each cell, from the terms of the four cells along each axis, as core/block_masks.py.
#ifndef LIB_BLOCK_MASKS
#define LIB_BLOCK_MASKS
#include "lib/active_hemisphere.glsl"

// Terms of four cells along an axis in the sums that half_ball_overlaps compares.
struct AxisTerms {
    vec4 near; // squared distance of the cell's nearest point from the centre
    vec4 far; // of its farthest point
    vec4 height; // greatest height over the plane
    vec4 near_height; // of the nearest point
};

// low, high: faces of the cells relative to the centre.
AxisTerms axis_terms(float normal, vec4 low, vec4 high) {
    vec4 nearest = max(low, min(high, vec4(0.0)));
    vec4 farthest = max(-low, high);
    precise vec4 near = nearest * nearest;
    precise vec4 far = farthest * farthest;
    precise vec4 low_height = normal * low;
    precise vec4 high_height = normal * high;
    precise vec4 near_height = normal * nearest;
    return AxisTerms(near, far, max(low_height, high_height), near_height);
}

float least(vec4 v) {
    return min(min(v.x, v.y), min(v.z, v.w));
}

float greatest(vec4 v) {
    return max(max(v.x, v.y), max(v.z, v.w));
}

// Sums of a row of cells along x.
vec4 row_sums(vec4 x, float y, float z) {
    precise vec4 sums = (x + y) + z;
    return sums;
}

uint row_bits(bvec4 row) {
    uvec4 bits = uvec4(row) << uvec4(0u, 1u, 2u, 3u);
    return (bits.x | bits.y) | (bits.z | bits.w);
}

// Bits of the cells that a block has, by their numbers along the axes, 1 to 4.
uvec2 cells_in_block(uvec3 counts) {
    uint row = (1u << counts.x) - 1u;
    uint plane = row * (0x1111u & ((1u << (4u * counts.y)) - 1u));
    uint two_planes = plane | (plane << 16u);
    return uvec2(counts.z > 1u ? two_planes : plane, counts.z > 3u ? two_planes : (counts.z > 2u ? plane : 0u));
}

// Mask of a block with faces of its cells in the frame; a block of less than four cells has its last one repeated.
uvec2 block_mask(HalfBall half_ball, vec4 low[3], vec4 high[3], uvec3 counts) {
    precise vec4 low_x = low[0] - half_ball.centre.x, high_x = high[0] - half_ball.centre.x;
    precise vec4 low_y = low[1] - half_ball.centre.y, high_y = high[1] - half_ball.centre.y;
    precise vec4 low_z = low[2] - half_ball.centre.z, high_z = high[2] - half_ball.centre.z;
    AxisTerms x = axis_terms(half_ball.normal.x, low_x, high_x);
    AxisTerms y = axis_terms(half_ball.normal.y, low_y, high_y);
    AxisTerms z = axis_terms(half_ball.normal.z, low_z, high_z);
    float radius_squared = half_ball.radius_squared;
    // Rounding is monotonic, so these bound the sums of all cells to the last bit.
    float least_near = component_sum(vec3(least(x.near), least(y.near), least(z.near)));
    float most_height = component_sum(vec3(greatest(x.height), greatest(y.height), greatest(z.height)));
    if (!(least_near <= radius_squared && most_height >= 0.0)) {
        return uvec2(0u);
    }
    uvec2 all_cells = cells_in_block(counts);
    float most_near = component_sum(vec3(greatest(x.near), greatest(y.near), greatest(z.near)));
    float most_far = component_sum(vec3(greatest(x.far), greatest(y.far), greatest(z.far)));
    float least_height = component_sum(vec3(least(x.height), least(y.height), least(z.height)));
    float front = component_sum(vec3(least(x.near_height), least(y.near_height), least(z.near_height)));
    if ((most_far <= radius_squared && least_height >= 0.0) || (front >= 0.0 && most_near <= radius_squared)) {
        return all_cells;
    }
    uvec2 reached = uvec2(0u), sure = uvec2(0u);
    for (uint row = 0u; row < 16u; ++row) {
        uint j = row & 3u, k = row >> 2u;
        bvec4 in_ball = lessThanEqual(row_sums(x.near, y.near[j], z.near[k]), vec4(radius_squared));
        bvec4 over_plane = greaterThanEqual(row_sums(x.height, y.height[j], z.height[k]), vec4(0.0));
        bvec4 wholly = lessThanEqual(row_sums(x.far, y.far[j], z.far[k]), vec4(radius_squared));
        bvec4 ahead = greaterThanEqual(row_sums(x.near_height, y.near_height[j], z.near_height[k]), vec4(0.0));
        uint row_reached = row_bits(in_ball) & row_bits(over_plane);
        uint row_sure = row_reached & (row_bits(wholly) | row_bits(ahead));
        uint shift = 4u * (row & 7u);
        uvec2 word = row < 8u ? uvec2(1u, 0u) : uvec2(0u, 1u);
        reached |= word * (row_reached << shift);
        sure |= word * (row_sure << shift);
    }
    reached &= all_cells;
    sure &= all_cells;
    uvec2 doubtful = reached & ~sure;
    while ((doubtful.x | doubtful.y) != 0u) {
        bool lower = doubtful.x != 0u;
        int bit = findLSB(lower ? doubtful.x : doubtful.y);
        uvec2 flag = lower ? uvec2(1u << bit, 0u) : uvec2(0u, 1u << bit);
        doubtful &= ~flag;
        int i = bit & 3, j = (bit >> 2) & 3, k = (bit >> 4) + (lower ? 0 : 2);
        if (plane_overlaps(half_ball, vec3(low_x[i], low_y[j], low_z[k]), vec3(high_x[i], high_y[j], high_z[k]))) {
            sure |= flag;
        }
    }
    return sure;
}

#endif
