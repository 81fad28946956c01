// SPDX-License-Identifier: GPL-3.0-or-later
// No clipping: a sphere with the same vector irradiance stands for the triangle, and the share of it above the horizon
// has a simple fit (Hill and Heitz 2016, the course named in rational_edge.glsl, slide 102; the exact share is in
// Snyder 1996, "Area light sources for real-time graphics").
#ifndef RIVALS_CLIPLESS_SPHERE
#define RIVALS_CLIPLESS_SPHERE
#include "../benchmarks/rivals/rational_edge.glsl"

// As triangle_form_factor.
float clipless_sphere_form_factor(
    vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius
) {
    if (dot(area_vector, v0 - p) >= 0.0) {
        return 0.0;
    }
    vec3 a = normalize(v0 - p), b = normalize(v1 - p), c = normalize(v2 - p);
    vec3 irradiance = rational_edge(b, a) + rational_edge(c, b) + rational_edge(a, c);
    float size = length(irradiance);
    return max((size * size + dot(n, irradiance)) / (size + 1.0), 0.0);
}
#endif
