// SPDX-License-Identifier: GPL-3.0-or-later
// How a triangle carries what is on it from one picture to another.
#ifndef LIB_TRIANGLE_MOTION
#define LIB_TRIANGLE_MOTION

// Way of a point of a triangle whose corners go by `ways`: between theirs, in proportion to its place among them. A
// triangle that is a line or a point gives the mean. What is the same for all corners is the same for the point, to
// the bit; what is 0 is 0.
vec3 moved_by(vec3 point, vec3 corners[3], vec3 ways[3]) {
    vec3 u = corners[1] - corners[0];
    vec3 v = corners[2] - corners[0];
    vec3 p = point - corners[0];
    vec3 normal = cross(u, v);
    float area = dot(normal, normal);
    vec2 share = vec2(1.0 / 3.0);
    if (area > 0.0) {
        // Never outside: rounding moves a sliver's points far along it.
        share = clamp(vec2(dot(cross(p, v), normal), dot(cross(u, p), normal)) / area, 0.0, 1.0);
        share /= max(share.x + share.y, 1.0);
    }
    return ways[0] + share.x * (ways[1] - ways[0]) + share.y * (ways[2] - ways[0]);
}

// A triangle's own frame: along its first side, across it, and its normal; all 0 where it has no area.
mat3 triangle_frame(vec3 side, vec3 other) {
    vec3 normal = cross(side, other);
    float area = dot(normal, normal);
    float length_squared = dot(side, side);
    if (!(area > 0.0 && length_squared > 0.0)) {
        return mat3(0.0);
    }
    vec3 along = side * inversesqrt(length_squared);
    normal *= inversesqrt(area);
    return mat3(along, cross(normal, along), normal);
}

// Rotation that takes directions on a triangle to where they point once its corners have gone by `ways`; the identity,
// to the bit, where they all go the same way or one of both triangles has no area.
mat3 turned_by(vec3 corners[3], vec3 ways[3]) {
    vec3 u = corners[1] - corners[0];
    vec3 v = corners[2] - corners[0];
    mat3 now = triangle_frame(u, v);
    mat3 then = triangle_frame(u + (ways[1] - ways[0]), v + (ways[2] - ways[0]));
    if ((ways[1] == ways[0] && ways[2] == ways[0]) || now[2] == vec3(0.0) || then[2] == vec3(0.0)) {
        return mat3(1.0);
    }
    return then * transpose(now);
}
#endif
