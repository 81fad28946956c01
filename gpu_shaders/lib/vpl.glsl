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
#endif
