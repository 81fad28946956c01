// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance from a triangle of constant radiosity; float32 form of vlm_addon/core/form_factor.py.
//
// Positions in metres from a local origin near the scene. The printed formula (seed 002, eq. 3.1) divides by lengths
// that vanish at contact and cancels far away; here nothing is normalised, edges are weighted by half-angle
// polynomials, and far triangles are integrated over their area.
#ifndef LIB_FORM_FACTOR
#define LIB_FORM_FACTOR

#define FORM_FACTOR_PI 3.14159265358979
// From this many bounding radii on the three-point area integral is good to 2e-7 absolute, 1e-3 / (d/R)^3 relative.
#define FORM_FACTOR_FAR 16.0
// Sine of the angle under which an edge passes the point below which its plane is noise.
#define FORM_FACTOR_ON_EDGE 1e-6

// 2 atan(sqrt u) / sqrt u for u in [0, 1], relative error 1e-7.
float double_arctangent_ratio(float u) {
    float sum = -0.00469328;
    sum = sum * u + 0.02425240;
    sum = sum * u - 0.05948639;
    sum = sum * u + 0.09914293;
    sum = sum * u - 0.14019481;
    sum = sum * u + 0.19969724;
    sum = sum * u - 0.33331991;
    return 2.0 * (sum * u + 0.9999999);
}

// Angle at the point between a and b, times the cosine between n and the plane through both: one edge's share of
// 2 pi E. a, b: m, from the point to the ends of an edge that runs clockwise seen from the point.
float edge_irradiance(vec3 a, vec3 b, float a_squared, float b_squared, vec3 n) {
    vec3 c = cross(a, b - a);
    float cos_r = dot(a, b);
    float r = sqrt(a_squared * b_squared);
    float c_squared = dot(c, c);
    float q = max(r + abs(cos_r), 1e-30);
    float ratio = double_arctangent_ratio(min(1.0, c_squared / (q * q))) / q;
    float least = FORM_FACTOR_ON_EDGE * r;
    // Over an acute angle nothing is divided by the length of c; with the point on the edge its direction is noise.
    float obtuse = c_squared > least * least ? FORM_FACTOR_PI * inversesqrt(max(c_squared, 1e-37)) - ratio : 0.0;
    return (cos_r >= 0.0 ? ratio : obtuse) * dot(n, c);
}

float edge_irradiance(vec3 a, vec3 b, vec3 n) {
    return edge_irradiance(a, b, dot(a, a), dot(b, b), n);
}

// Angle between a and b in [0, pi]: the arc along the horizon. Lies on the rim of the cosine-weighted disk, so it
// always adds.
float horizon_arc(vec3 a, vec3 b) {
    vec3 c = cross(a, b - a);
    float cos_r = dot(a, b);
    float t = length(c) / max(sqrt(dot(a, a) * dot(b, b)) + abs(cos_r), 1e-30);
    float angle = double_arctangent_ratio(min(1.0, t * t)) * t;
    return cos_r >= 0.0 ? angle : FORM_FACTOR_PI - angle;
}

// Mean over three points of height / distance^4, in 1/m^3. a, b, c: m, from the point. heights: m, of a, b and c.
float far_integrand(vec3 a, vec3 b, vec3 c, vec3 heights) {
    vec3 sum = a + b + c;
    vec3 middle_heights = 0.5 * (heights + (heights.x + heights.y + heights.z) * (1.0 / 3.0));
    vec3 middle = sum * (1.0 / 6.0);
    vec3 ma = middle + 0.5 * a, mb = middle + 0.5 * b, mc = middle + 0.5 * c;
    vec3 inverse = 1.0 / vec3(dot(ma, ma), dot(mb, mb), dot(mc, mc));
    return dot(middle_heights * inverse, inverse) * (1.0 / 3.0);
}

// Share of the hemisphere over p with normal n that a triangle fills, cosine-weighted, clipped at the horizon; in
// [0, 1], exactly 0 behind the triangle and where it is wholly below the horizon.
// p, v0, v1, v2: m. n: unit. area_vector: m², area times normal on the emitting (counter-clockwise) side, stored with
// the triangle. bounding_radius: m, largest distance of a corner from the centroid.
float triangle_form_factor(
    vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius
) {
    vec3 a = v0 - p, b = v1 - p, c = v2 - p;
    float plane_distance_area = -dot(area_vector, a);
    vec3 heights = vec3(dot(n, a), dot(n, b), dot(n, c));
    if (!(plane_distance_area > 0.0) || max(max(heights.x, heights.y), heights.z) <= 0.0) {
        return 0.0;
    }
    // The corner that is alone on its side of the horizon comes first. Software renderers run every branch, so what
    // differs between the cases is chosen and the rest is shared.
    bvec3 above = greaterThan(heights, vec3(0.0));
    int count = int(above.x) + int(above.y) + int(above.z);
    bool whole = count == 3, lone_above = count == 1;
    bool second = !whole && above.y == lone_above && above.x != lone_above;
    bool third = !whole && above.z == lone_above && above.x != lone_above;
    mat3 corners = mat3(a, b, c);
    a = second ? corners[1] : third ? corners[2] : corners[0];
    b = second ? corners[2] : third ? corners[0] : corners[1];
    c = second ? corners[0] : third ? corners[1] : corners[2];
    heights = second ? heights.yzx : third ? heights.zxy : heights;
    float t_b = heights.x / (whole ? 1.0 : heights.x - heights.y);
    float t_c = heights.x / (whole ? 1.0 : heights.x - heights.z);
    vec3 on_ab = a + (b - a) * t_b, on_ac = a + (c - a) * t_c;

    vec3 middle = (a + b + c) * (1.0 / 3.0);
    float far = FORM_FACTOR_FAR * bounding_radius;
    if (dot(middle, middle) > far * far) {
        float all_of_it = far_integrand(a, b, c, heights);
        float corner = t_b * t_c * far_integrand(a, on_ab, on_ac, vec3(heights.x, 0.0, 0.0));
        float integrand = whole ? all_of_it : lone_above ? corner : all_of_it - corner;
        return max(integrand * plane_distance_area * (1.0 / FORM_FACTOR_PI), 0.0);
    }
    // Outline q0 q1 q2 q3 with the arc along the horizon, if any, from q2 to q3; repeated corners add nothing.
    vec3 q0 = whole || lone_above ? a : b;
    vec3 q1 = lone_above ? a : whole ? b : c;
    vec3 q2 = whole ? c : lone_above ? on_ab : on_ac;
    vec3 q3 = whole ? c : lone_above ? on_ac : on_ab;
    vec4 squared = vec4(dot(q0, q0), dot(q1, q1), dot(q2, q2), dot(q3, q3));
    float sum = horizon_arc(q2, q3) + edge_irradiance(q1, q0, squared.y, squared.x, n)
        + edge_irradiance(q2, q1, squared.z, squared.y, n) + edge_irradiance(q0, q3, squared.x, squared.w, n);
    return clamp(sum * (0.5 / FORM_FACTOR_PI), 0.0, 1.0);
}

// The same for a triangle whose bounding radius is not stored.
float triangle_form_factor(vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector) {
    vec3 middle = (v0 + v1 + v2) * (1.0 / 3.0);
    vec3 r0 = v0 - middle, r1 = v1 - middle, r2 = v2 - middle;
    float radius = sqrt(max(max(dot(r0, r0), dot(r1, r1)), dot(r2, r2)));
    return triangle_form_factor(p, n, v0, v1, v2, area_vector, radius);
}
#endif
