// SPDX-License-Identifier: GPL-3.0-or-later
// Does a light's active hemisphere reach a box? The same roundings in the same order as core/active_hemisphere.py, so
// that both decide alike: no division, no root, and `precise` against fused or reordered operations.
// Lengths are in the grid's frame; a negative squared radius is a half ball without any point.
#ifndef LIB_ACTIVE_HEMISPHERE
#define LIB_ACTIVE_HEMISPHERE
#include "gpu_layout/HalfBall"

float component_sum(vec3 v) {
    precise float sum = (v.x + v.y) + v.z;
    return sum;
}

float squared_length(vec3 v) {
    precise vec3 squares = v * v;
    return component_sum(squares);
}

float height_over_plane(vec3 normal, vec3 v) {
    precise vec3 parts = normal * v;
    return component_sum(parts);
}

// False only where ball and box, or half space and box, do not overlap. What holds for a box holds for every larger
// one, rounding included. low, high: corners of the box relative to the centre.
bool may_overlap(HalfBall half_ball, vec3 low, vec3 high) {
    vec3 near = max(low, min(high, vec3(0.0)));
    precise vec3 low_parts = half_ball.normal * low;
    precise vec3 high_parts = half_ball.normal * high;
    float height = component_sum(max(low_parts, high_parts));
    return squared_length(near) <= half_ball.radius_squared && height >= 0.0;
}

// The point clamp(t normal) of a box whose coordinates move between the values `starts` and `stops` of t.
vec3 point_at(float t, vec3 normal, vec3 low, vec3 high, vec3 starts, vec3 stops) {
    precise vec3 along = t * normal;
    vec3 moving = max(low, min(high, along));
    vec3 started = mix(moving, low, lessThan(vec3(t), starts));
    return mix(started, high, greaterThanEqual(vec3(t), stops));
}

// Whether the light's disc and the box overlap; the plane cuts the box, whose near point is behind it.
bool plane_overlaps(HalfBall half_ball, vec3 box_low, vec3 box_high) {
    bvec3 flipped = lessThan(half_ball.normal, vec3(0.0));
    vec3 low = mix(box_low, -box_high, flipped), high = mix(box_high, -box_low, flipped);
    vec3 normal = abs(half_ball.normal), inverse = abs(half_ball.inverse_normal);
    precise vec3 starts = max(low, vec3(0.0)) * inverse;
    precise vec3 stops = max(high, vec3(0.0)) * inverse;

    float last_below = 0.0, first_above = uintBitsToFloat(0x7f800000u);
    float bends[6] = float[6](starts.x, starts.y, starts.z, stops.x, stops.y, stops.z);
    for (int k = 0; k < 6; ++k) {
        float t = bends[k];
        if (height_over_plane(normal, point_at(t, normal, low, high, starts, stops)) < 0.0) {
            last_below = max(last_below, t);
        } else {
            first_above = min(first_above, t);
        }
    }

    bvec3 stopped = greaterThanEqual(vec3(last_below), stops);
    bvec3 waiting = lessThanEqual(vec3(first_above), starts);
    vec3 fixed_part = mix(mix(vec3(0.0), low, waiting), high, stopped);
    vec3 moving_part = mix(mix(normal, vec3(0.0), waiting), vec3(0.0), stopped);
    float moving_squared = squared_length(moving_part);
    float offset = height_over_plane(normal, fixed_part);
    precise float room = half_ball.radius_squared - squared_length(fixed_part);
    precise float offset_squared = offset * offset;
    precise float allowed = room * moving_squared;
    return (room > 0.0 && offset_squared <= allowed) || (room >= 0.0 && offset == 0.0);
}

// Whether the half ball and the closed box between two corners in the frame have a point in common.
bool half_ball_overlaps(HalfBall half_ball, vec3 box_low, vec3 box_high) {
    precise vec3 low = box_low - half_ball.centre;
    precise vec3 high = box_high - half_ball.centre;
    if (!may_overlap(half_ball, low, high)) {
        return false;
    }
    vec3 near = max(low, min(high, vec3(0.0)));
    return height_over_plane(half_ball.normal, near) >= 0.0
        || squared_length(max(-low, high)) <= half_ball.radius_squared
        || plane_overlaps(half_ball, low, high);
}

#endif
