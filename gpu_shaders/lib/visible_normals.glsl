// SPDX-License-Identifier: GPL-3.0-or-later
// Directions that a GGX lobe reflects into, as dense as the lobe itself but for its shadowing.
#ifndef LIB_VISIBLE_NORMALS
#define LIB_VISIBLE_NORMALS
#include "lib/surface.glsl"

// Half vector of a GGX surface, as dense as to_view sees its facets: a point of the cap of the sphere that the view sees
// lit (Dupuy and Benyoub 2023). normal, to_view: unit, the view above the surface; alpha: roughness squared; numbers: in
// [0, 1).
vec3 visible_normal(vec3 normal, vec3 to_view, float alpha, vec2 numbers) {
    float cos_view = max(dot(normal, to_view), 0.0);
    vec3 across = to_view - dot(normal, to_view) * normal;
    vec3 axis = abs(normal.z) < 0.7 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0);
    vec3 tangent = unit_or(across, normalize(cross(normal, axis)));
    vec3 bitangent = cross(normal, tangent);
    // Stretched so that the surface is a half sphere.
    vec3 stretched = normalize(alpha * across + cos_view * normal);
    float height = dot(stretched, normal);
    float z = (1.0 - numbers.y) * (1.0 + height) - height;
    float radius = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    float turn = 6.2831853 * numbers.x;
    vec3 facet = radius * (cos(turn) * tangent + sin(turn) * bitangent) + z * normal + stretched;
    float along = max(dot(facet, normal), 0.0);
    return unit_or(alpha * (facet - dot(facet, normal) * normal) + along * normal, normal);
}

// How dense visible_normal makes the directions that light is reflected from, 1/sr: of one whose half vector is at cos_half
// to the surface's normal.
float reflection_density(float cos_half, float cos_view, float alpha) {
    float alpha_squared = alpha * alpha;
    float sine_squared = max((1.0 - cos_half) * (1.0 + cos_half), 0.0);
    float denominator = alpha_squared + sine_squared * (1.0 - alpha_squared);
    float view_root = sqrt(alpha_squared + (1.0 - alpha_squared) * cos_view * cos_view);
    float facets = alpha_squared * 0.318309886183791 / max(denominator * denominator, 1e-30);
    return facets * 0.5 / max(cos_view + view_root, 1e-20);
}
#endif
