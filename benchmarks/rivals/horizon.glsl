// SPDX-License-Identifier: GPL-3.0-or-later
// Clips a triangle at the horizon, for rivals whose formula holds for light wholly above it. The same work as in
// lib/form_factor.glsl, without its care for corners that almost touch the point.
#ifndef RIVALS_HORIZON
#define RIVALS_HORIZON

#define RIVALS_PI 3.14159265358979

// Corners of what is above the horizon, in m from the point, in the triangle's order; repeated where it has fewer.
struct RivalOutline {
    vec3 q0, q1, q2, q3;
};

// Whether anything sends light to p with unit normal n. v0, v1, v2: m. area_vector: m², along the emitting side.
bool rival_outline(vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, out RivalOutline outline) {
    vec3 a = v0 - p, b = v1 - p, c = v2 - p;
    vec3 heights = vec3(dot(n, a), dot(n, b), dot(n, c));
    if (dot(area_vector, a) >= 0.0 || max(max(heights.x, heights.y), heights.z) <= 0.0) {
        return false;
    }
    bool a_above = heights.x > 0.0, b_above = heights.y > 0.0, c_above = heights.z > 0.0;
    bool whole = a_above && b_above && c_above;
    // The corner that is alone on its side of the horizon comes first.
    bool second = a_above == c_above && a_above != b_above;
    bool third = a_above == b_above && a_above != c_above;
    vec3 first = second ? b : third ? c : a;
    vec3 next = second ? c : third ? a : b;
    vec3 last = second ? a : third ? b : c;
    vec3 h = second ? heights.yzx : third ? heights.zxy : heights;
    bool lone_above = !whole && h.x > 0.0;
    vec3 to_next = first + (next - first) * (h.x / (whole ? 1.0 : h.x - h.y));
    vec3 to_last = first + (last - first) * (h.x / (whole ? 1.0 : h.x - h.z));
    outline.q0 = whole || lone_above ? first : next;
    outline.q1 = lone_above ? to_next : whole ? next : last;
    outline.q2 = whole ? last : to_last;
    outline.q3 = whole || lone_above ? outline.q2 : to_next;
    return true;
}
#endif
