// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance from a triangle of constant radiosity; float32 form of vlm_addon/core/form_factor.py.
//
// Positions in metres from a local origin near the scene. The printed formula (seed 002, eq. 3.1) divides by lengths
// that vanish at contact and cancels far away; here edges are weighted by half-angle polynomials, nothing is divided by
// what may vanish, and far triangles are integrated over their area. Everything is done in units of about the light's
// size, so that no product leaves float32's range at any scale.
#ifndef LIB_FORM_FACTOR
#define LIB_FORM_FACTOR

#define FORM_FACTOR_PI 3.14159265358979
// Bounding radii from which on a triangle is integrated over its area: 1e-7 absolute, and relative to a triangle that
// faces the point squarely 1e-3 / distance³ or 3e-7, whichever is more. The edges, which cancel, lose as much there.
#define FORM_FACTOR_FAR 16.0

// 2 atan(sqrt u) / sqrt u for u in [0, 1], relative error 1e-7; in halves that do not wait for each other.
float double_arctangent_ratio(float u) {
    float v = u * u;
    float low = (1.9999998 - 0.66663982 * u) + (0.39939448 - 0.28038962 * u) * v;
    float high = (0.19828586 - 0.11897278 * u) + (0.04850480 - 0.00938656 * u) * v;
    return low + high * (v * v);
}

// Direction of a x b, its length the tangent of half the angle between a and b or, where cosine = a b < 0, of half
// what is left to a half turn. From the span, which loses nothing where a and b almost agree, and the shorter of them,
// which loses nothing where one almost touches the point.
vec3 half_angle_normal(vec3 a, vec3 b, float a_length, float b_length, float cosine) {
    // One division, not one for each component.
    return cross(a_length < b_length ? a : b, b - a) * (1.0 / max(a_length * b_length + abs(cosine), 1e-37));
}

// Angle at the point between a and b, times the cosine between n and the plane through both: one edge's share of
// 2 pi E. a, b: from the point to the ends of an edge that runs clockwise seen from the point. cosine: a b.
// Exactly reversed by exchanging a and b, so that triangles that share an edge cancel along it however near it is.
float edge_irradiance(vec3 a, vec3 b, float a_length, float b_length, float cosine, vec3 n) {
    vec3 s = half_angle_normal(a, b, a_length, b_length, cosine);
    float u = dot(s, s);
    float acute = double_arctangent_ratio(u);
    float obtuse = FORM_FACTOR_PI * inversesqrt(max(u, 1e-37)) - acute;
    return (cosine >= 0.0 ? acute : obtuse) * dot(n, s);
}

float edge_irradiance(vec3 a, vec3 b, vec3 n) {
    return edge_irradiance(a, b, length(a), length(b), dot(a, b), n);
}

// Angle along the horizon from a, where the outline goes under, to b, where it comes up. On the rim of the
// cosine-weighted disk, so the whole of it counts; but only what of it lies along the horizon, and with its sign, or
// the rounding of a and b would lend a sliver an arc that its edges do not take back.
float horizon_arc(vec3 a, vec3 b, vec3 n) {
    float cosine = dot(a, b);
    float t = dot(n, half_angle_normal(b, a, length(b), length(a), cosine));
    float angle = double_arctangent_ratio(t * t) * t;
    return cosine >= 0.0 ? angle : FORM_FACTOR_PI - angle;
}

// Where an edge with one end above the horizon meets it; anything finite for other edges. The same to the last bit
// (unless both ends are equally far from it) whichever end is called a. Starts from the end closer to the horizon,
// which may almost touch the point.
vec3 edge_at_horizon(vec3 a, vec3 b, float height_a, float height_b) {
    bool a_closer = abs(height_a) < abs(height_b);
    float rise = height_a - height_b;
    return (a_closer ? a : b) + (b - a) * ((a_closer ? height_a : height_b) / (rise != 0.0 ? rise : 1.0));
}

// What of a triangle is above the horizon: q0 q1 q2 q3, with an arc along the horizon from q2 to q3 where it is cut.
// Corners repeat where it has fewer.
struct VisibleOutline {
    vec3 q0, q1, q2, q3;
    vec3 heights;               // of q0, q1, q2; q3 is on the horizon or repeats q2
    float area_012, area_023;   // of the two triangles, over the whole triangle's
};

// a, b, c: from the point to the corners, heights: of them over the horizon, one at least above 0.
VisibleOutline visible_outline(vec3 a, vec3 b, vec3 c, vec3 heights) {
    // The corner that is alone on its side of the horizon comes first. Software renderers run every branch, so what
    // differs between the cases is chosen and the rest is shared.
    bool a_above = heights.x > 0.0, b_above = heights.y > 0.0, c_above = heights.z > 0.0;
    bool whole = a_above && b_above && c_above;
    bool second = a_above == c_above && a_above != b_above, third = a_above == b_above && a_above != c_above;
    vec3 first = second ? b : third ? c : a;
    vec3 next = second ? c : third ? a : b;
    vec3 last = second ? a : third ? b : c;
    vec3 h = second ? heights.yzx : third ? heights.zxy : heights;
    bool lone_above = !whole && h.x > 0.0;
    vec3 to_next = edge_at_horizon(first, next, h.x, h.y), to_last = edge_at_horizon(first, last, h.x, h.z);
    // Shares of the edges from the first corner up to the horizon.
    float share_next = whole ? 0.0 : h.x / (h.x - h.y), share_last = whole ? 0.0 : h.x / (h.x - h.z);
    bool has_first = whole || lone_above;
    VisibleOutline outline;
    outline.q0 = has_first ? first : next;
    outline.q1 = lone_above ? first : whole ? next : last;
    outline.q2 = whole ? last : lone_above ? to_next : to_last;
    outline.q3 = whole ? last : lone_above ? to_last : to_next;
    outline.heights = whole ? h : lone_above ? vec3(h.x, h.x, 0.0) : vec3(h.y, h.z, 0.0);
    outline.area_012 = lone_above ? 0.0 : 1.0 - share_last;
    outline.area_023 = share_last * (lone_above ? share_next : 1.0 - share_next);
    return outline;
}

// Mean over a triangle of height / distance^4, from the midpoints of its edges: exact for quadratic functions.
// heights, inverse: of the midpoints, times 2 and 1 / (4 distance²).
float midpoint_mean(vec3 heights, vec3 inverse) {
    return dot(heights * inverse, inverse) * (8.0 / 3.0);
}

// The same over an outline, 0 below the horizon, per area of the whole triangle. squared: of q0 to q3. products: q0 q1,
// q1 q2, q0 q2, q0 q3.
float far_integrand(VisibleOutline outline, vec4 squared, vec4 products) {
    vec3 h = outline.heights;
    vec4 inverse = 1.0 / (squared.xyxx + squared.yzzw + 2.0 * products);
    // Between q2 and q3 all heights are 0, or there is nothing.
    return outline.area_012 * midpoint_mean(vec3(h.x + h.y, h.y + h.z, h.x + h.z), inverse.xyz)
        + outline.area_023 * midpoint_mean(vec3(h.x + h.z, 0.0, h.x), inverse.zyw);
}

// A power of two, which scales without rounding, that makes `radius` 1/8 to 1/4: sums of lengths stay finite wherever
// each of them is.
float unit_scale(float radius) {
    return uintBitsToFloat((251u << 23) - (floatBitsToUint(radius) & 0x7f800000u));
}

// Most that a polygon can give: between its plane and the horizon a lune of the hemisphere is left. Where the polygon
// faces as the surface does that is little; in its plane, where rounded edges may wind around the point, nothing.
float most_form_factor(vec3 n, vec3 area) {
    return clamp(0.5 - 0.5 * dot(n, area) * inversesqrt(max(dot(area, area), 1e-37)), 0.0, 1.0);
}

// Share of the hemisphere over p with normal n that a triangle fills, cosine-weighted, clipped at the horizon; in
// [0, 1], exactly 0 behind the triangle and where it is wholly below the horizon.
// p, v0, v1, v2: m. n: unit. area_vector: m², area times normal on the emitting (counter-clockwise) side, stored with
// the triangle. bounding_radius: m, largest distance of a corner from the centroid.
float triangle_form_factor(
    vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius
) {
    float scale = unit_scale(bounding_radius);
    vec3 a = (v0 - p) * scale, b = (v1 - p) * scale, c = (v2 - p) * scale;
    vec3 area = area_vector * scale * scale;
    float plane_distance_area = -dot(area, a);
    vec3 heights = vec3(dot(n, a), dot(n, b), dot(n, c));
    // Written so that NaN, of lights without size, gives 0.
    if (!(plane_distance_area > 0.0) || max(max(heights.x, heights.y), heights.z) <= 0.0) {
        return 0.0;
    }
    VisibleOutline outline = visible_outline(a, b, c, heights);
    vec3 q0 = outline.q0, q1 = outline.q1, q2 = outline.q2, q3 = outline.q3;
    vec4 squared = vec4(dot(q0, q0), dot(q1, q1), dot(q2, q2), dot(q3, q3));
    vec4 products = vec4(dot(q0, q1), dot(q1, q2), dot(q0, q2), dot(q0, q3));
    float far = FORM_FACTOR_FAR * scale * bounding_radius;
    if (squared.x > far * far) {
        return far_integrand(outline, squared, products) * plane_distance_area * (1.0 / FORM_FACTOR_PI);
    }
    vec4 lengths = sqrt(squared);
    float sum = horizon_arc(q2, q3, n) + edge_irradiance(q1, q0, lengths.y, lengths.x, products.x, n)
        + edge_irradiance(q2, q1, lengths.z, lengths.y, products.y, n)
        + edge_irradiance(q0, q3, lengths.x, lengths.w, products.w, n);
    return clamp(sum * (0.5 / FORM_FACTOR_PI), 0.0, most_form_factor(n, area));
}

// The same for a triangle whose bounding radius is not stored.
float triangle_form_factor(vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector) {
    vec3 middle = (v0 + v1 + v2) * (1.0 / 3.0);
    vec3 r0 = v0 - middle, r1 = v1 - middle, r2 = v2 - middle;
    float radius = sqrt(max(max(dot(r0, r0), dot(r1, r1)), dot(r2, r2)));
    return triangle_form_factor(p, n, v0, v1, v2, area_vector, radius);
}
#endif
