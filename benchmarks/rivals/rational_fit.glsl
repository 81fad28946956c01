// SPDX-License-Identifier: GPL-3.0-or-later
// Edge integrals by rational fit over what is above the horizon (sources in rational_edge.glsl).
#ifndef RIVALS_RATIONAL_FIT
#define RIVALS_RATIONAL_FIT
#include "../benchmarks/rivals/horizon.glsl"
#include "../benchmarks/rivals/rational_edge.glsl"

// As triangle_form_factor.
float rational_fit_form_factor(
    vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius
) {
    RivalOutline outline;
    if (!rival_outline(p, n, v0, v1, v2, area_vector, outline)) {
        return 0.0;
    }
    vec3 a = normalize(outline.q0), b = normalize(outline.q1), c = normalize(outline.q2), d = normalize(outline.q3);
    vec3 sum = rational_edge(b, a) + rational_edge(c, b) + rational_edge(d, c) + rational_edge(a, d);
    return max(dot(n, sum), 0.0);
}
#endif
