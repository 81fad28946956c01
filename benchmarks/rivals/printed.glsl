// SPDX-License-Identifier: GPL-3.0-or-later
// The formula as printed (seed 002, eq. 3.1; Baum, Rushmeier and Winget 1989, "Improving radiosity solutions through
// the use of analytically determined form-factors"): unit vectors, arc cosine, unit cross product.
#ifndef RIVALS_PRINTED
#define RIVALS_PRINTED
#include "../benchmarks/rivals/horizon.glsl"

float printed_edge(vec3 a, vec3 b, vec3 n) {
    return acos(dot(a, b)) * dot(n, normalize(cross(a, b)));
}

// As triangle_form_factor.
float printed_form_factor(
    vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius
) {
    RivalOutline outline;
    if (!rival_outline(p, n, v0, v1, v2, area_vector, outline)) {
        return 0.0;
    }
    vec3 a = normalize(outline.q0), b = normalize(outline.q1), c = normalize(outline.q2), d = normalize(outline.q3);
    float sum = printed_edge(b, a, n) + printed_edge(c, b, n);
    // A triangle has no fourth edge: without length it would have no plane either.
    if (outline.q2 == outline.q3) {
        sum += printed_edge(a, c, n);
    } else {
        sum += printed_edge(d, c, n) + printed_edge(a, d, n);
    }
    return sum * (0.5 / RIVALS_PI);
}
#endif
