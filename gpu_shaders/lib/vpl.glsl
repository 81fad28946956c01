// SPDX-License-Identifier: GPL-3.0-or-later
// Light of virtual point lights; float32 form of vlm_addon/core/vpl.py.
#ifndef LIB_VPL
#define LIB_VPL
#include "lib/form_factor.glsl"

// Keeps float32 finite.
#define LEAST_VPL_REACH 1e-30

// What a light of 1 W brings to the point p with unit normal n, 1/m². q, m: place and unit normal of the light; area: of
// the piece of surface that it stands for, m². x: with the bounded term; y: what the bound takes off.
vec2 bounded_geometry(vec3 p, vec3 n, vec3 q, vec3 m, float area) {
    vec3 towards = q - p;
    float distance_squared = dot(towards, towards);
    float received = max(dot(towards, n), 0.0), emitted = max(-dot(towards, m), 0.0);
    float facing = received * emitted / max(distance_squared, LEAST_VPL_REACH);
    float reach = max(FORM_FACTOR_PI * distance_squared, LEAST_VPL_REACH);
    float whole = reach + area;
    return vec2(facing / whole, facing / reach * (area / whole));
}

// From this many sides of its square on, squared, a piece of surface is a point.
#define FAR_PIECE 16.0
// Of the half of a square, largest distance of a corner from its centroid: of the square's side.
#define HALF_SQUARE_RADIUS 0.745356

// The same from the piece itself, a square around q, exact near it. Unlike the bounded term it loses no light, but for
// what of the square is below the horizon where two surfaces meet; it never exceeds 1 / area either.
float piece_geometry(vec3 p, vec3 n, vec3 q, vec3 m, float area) {
    vec3 towards = q - p;
    float distance_squared = dot(towards, towards);
    if (distance_squared >= FAR_PIECE * area) {
        float received = max(dot(towards, n), 0.0), emitted = max(-dot(towards, m), 0.0);
        float squared = max(distance_squared, LEAST_VPL_REACH);
        return received / squared * (emitted / squared) * (1.0 / FORM_FACTOR_PI);
    }
    float side = sqrt(area), radius = HALF_SQUARE_RADIUS * side;
    float turn = m.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (turn + m.z), b = m.x * m.y * a;
    vec3 u = vec3(1.0 + turn * m.x * m.x * a, turn * b, -turn * m.x) * (0.5 * side);
    vec3 v = vec3(b, turn + m.y * m.y * a, -m.y) * (0.5 * side);
    vec3 c0 = q - u - v, c1 = q + u - v, c2 = q + u + v, c3 = q - u + v;
    vec3 half_area = (0.5 * area) * m;
    float sum = triangle_form_factor(p, n, c0, c1, c2, half_area, radius)
        + triangle_form_factor(p, n, c0, c2, c3, half_area, radius);
    return sum / area;
}
#endif
