// SPDX-License-Identifier: GPL-3.0-or-later
// Directions of points of the unit square.
#ifndef LIB_DIRECTIONS
#define LIB_DIRECTIONS

#define DIRECTIONS_TWO_PI 6.2831853

// Unit vector to a point of the sphere, evenly spread as the points are.
vec3 sphere_point(vec2 point) {
    float height = 2.0 * point.y - 1.0, turn = DIRECTIONS_TWO_PI * point.x;
    return vec3(vec2(cos(turn), sin(turn)) * sqrt(max(1.0 - height * height, 0.0)), height);
}

// Unit direction over a surface, as dense as the cosine to its unit normal: through the sphere that touches the surface.
vec3 cosine_direction(vec3 normal, vec2 point) {
    vec3 through = normal + sphere_point(point);
    float squared = dot(through, through);
    return squared > 1e-12 ? through * inversesqrt(squared) : normal;
}
#endif
