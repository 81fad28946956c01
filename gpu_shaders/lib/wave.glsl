// SPDX-License-Identifier: GPL-3.0-or-later
// Light of the virtual point lights of a wave (seed 000, 4.2); float32 form of vlm_addon/core/stacked_hemispheres.py.
#ifndef LIB_WAVE
#define LIB_WAVE

// What of its light a light sends in directions of this cosine to its normal, 0 to 1.
float emission_share(float cosine) {
    return clamp((cosine - LEAST_COSINE) / (1.0 - LEAST_COSINE), 0.0, 1.0);
}

// From p to a light: unit direction, or zero where p touches it.
vec3 towards_light(vec3 p, vec3 light) {
    vec3 offset = light - p;
    float squared = dot(offset, offset);
    return squared > 0.0 ? offset * inversesqrt(max(squared, 1e-30)) : vec3(0.0);
}

// Barycentric coordinates of p, or of its projection, in a triangle: each in [0, 1], together 1.
vec3 barycentric(vec3 p, vec3 a, vec3 b, vec3 c) {
    vec3 u = b - a, v = c - a, w = p - a;
    float uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v);
    float determinant = uu * vv - uv * uv;
    if (determinant <= 0.0) {
        return vec3(1.0 / 3.0);
    }
    vec2 along = vec2(vv * wu - uv * wv, uu * wv - uv * wu) / determinant;
    vec3 weights = clamp(vec3(1.0 - along.x - along.y, along), 0.0, 1.0);
    return weights / (weights.x + weights.y + weights.z);
}
#endif
