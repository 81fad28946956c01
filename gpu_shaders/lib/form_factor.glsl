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
// 2 pi E. a, b: m, from the point to the ends of an edge as it runs counter-clockwise seen from the light's back.
float edge_irradiance(vec3 a, vec3 b, vec3 n) {
    vec3 c = cross(a, b - a);
    float cos_r = dot(a, b);
    float r = sqrt(dot(a, a) * dot(b, b));
    float c_squared = dot(c, c);
    float q = max(r + abs(cos_r), 1e-30);
    float ratio = double_arctangent_ratio(min(1.0, c_squared / (q * q))) / q;
    float projected = dot(n, c);
    if (cos_r >= 0.0) {
        return ratio * projected;
    }
    float c_length = sqrt(c_squared);
    if (c_length <= FORM_FACTOR_ON_EDGE * r) {
        return 0.0;
    }
    return (FORM_FACTOR_PI / c_length - ratio) * projected;
}

// Angle between a and b in [0, pi]: the arc along the horizon. Lies on the rim of the cosine-weighted disk, so it
// always adds.
float horizon_arc(vec3 a, vec3 b) {
    vec3 c = cross(a, b - a);
    float cos_r = dot(a, b);
    float c_length = length(c);
    float t = c_length / max(sqrt(dot(a, a) * dot(b, b)) + abs(cos_r), 1e-30);
    float angle = double_arctangent_ratio(min(1.0, t * t)) * t;
    return cos_r >= 0.0 ? angle : FORM_FACTOR_PI - angle;
}

// Mean over three points of height / distance^4, in 1/m^3. a, b, c: m, from the point. heights: m, of a, b and c.
float far_integrand(vec3 a, vec3 b, vec3 c, vec3 heights) {
    vec3 middle = (a + b + c) * (1.0 / 3.0);
    vec3 middle_heights = 0.5 * (heights + (heights.x + heights.y + heights.z) * (1.0 / 3.0));
    vec3 ma = 0.5 * (middle + a), mb = 0.5 * (middle + b), mc = 0.5 * (middle + c);
    vec3 inverse = 1.0 / vec3(dot(ma, ma), dot(mb, mb), dot(mc, mc));
    return dot(middle_heights * inverse, inverse) * (1.0 / 3.0);
}

// The part above the horizon of a far triangle of which one corner, a, is on the other side than b and c.
// Returns the share of the triangle times the mean of its integrand, 1/m^3.
float far_corner_integrand(vec3 a, vec3 b, vec3 c, vec3 heights) {
    float t_b = heights.x / (heights.x - heights.y);
    float t_c = heights.x / (heights.x - heights.z);
    return t_b * t_c * far_integrand(a, a + (b - a) * t_b, a + (c - a) * t_c, vec3(heights.x, 0.0, 0.0));
}

// Mean of height / distance^4 over the part of a far triangle above the horizon, times that part's share, 1/m^3.
float clipped_far_integrand(vec3 a, vec3 b, vec3 c, vec3 heights) {
    bvec3 above = greaterThan(heights, vec3(0.0));
    int count = int(above.x) + int(above.y) + int(above.z);
    if (count == 3) {
        return far_integrand(a, b, c, heights);
    }
    // The corner that stands alone comes first.
    bool lone_above = count == 1;
    if (above.y == lone_above) {
        return lone_above ? far_corner_integrand(b, c, a, heights.yzx)
            : far_integrand(a, b, c, heights) - far_corner_integrand(b, c, a, heights.yzx);
    }
    if (above.z == lone_above) {
        return lone_above ? far_corner_integrand(c, a, b, heights.zxy)
            : far_integrand(a, b, c, heights) - far_corner_integrand(c, a, b, heights.zxy);
    }
    return lone_above ? far_corner_integrand(a, b, c, heights)
        : far_integrand(a, b, c, heights) - far_corner_integrand(a, b, c, heights);
}

// Sum over the edges above the horizon and the arc that closes the outline: 2 pi E.
// a, b, c: m, from the point, counter-clockwise seen from the point.
float near_irradiance(vec3 a, vec3 b, vec3 c, vec3 heights, vec3 n) {
    bvec3 above = greaterThan(heights, vec3(0.0));
    // Where each edge meets the horizon; used only for edges with one end above.
    vec3 on_ab = a + (b - a) * (heights.x / (above.x != above.y ? heights.x - heights.y : 1.0));
    vec3 on_bc = b + (c - b) * (heights.y / (above.y != above.z ? heights.y - heights.z : 1.0));
    vec3 on_ca = c + (a - c) * (heights.z / (above.z != above.x ? heights.z - heights.x : 1.0));
    float sum = 0.0;
    if (above.x || above.y) {
        sum += edge_irradiance(above.y ? b : on_ab, above.x ? a : on_ab, n);
    }
    if (above.y || above.z) {
        sum += edge_irradiance(above.z ? c : on_bc, above.y ? b : on_bc, n);
    }
    if (above.z || above.x) {
        sum += edge_irradiance(above.x ? a : on_ca, above.z ? c : on_ca, n);
    }
    if (!all(above)) {
        vec3 exit_point = above.x && !above.y ? on_ab : above.y && !above.z ? on_bc : on_ca;
        vec3 entry_point = !above.x && above.y ? on_ab : !above.y && above.z ? on_bc : on_ca;
        sum += horizon_arc(exit_point, entry_point);
    }
    return sum;
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
    vec3 middle = (a + b + c) * (1.0 / 3.0);
    float far = FORM_FACTOR_FAR * bounding_radius;
    if (dot(middle, middle) > far * far) {
        return max(clipped_far_integrand(a, b, c, heights) * plane_distance_area * (1.0 / FORM_FACTOR_PI), 0.0);
    }
    return clamp(near_irradiance(a, b, c, heights, n) * (0.5 / FORM_FACTOR_PI), 0.0, 1.0);
}

// The same for a triangle whose bounding radius is not stored.
float triangle_form_factor(vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector) {
    vec3 middle = (v0 + v1 + v2) * (1.0 / 3.0);
    vec3 r0 = v0 - middle, r1 = v1 - middle, r2 = v2 - middle;
    float radius = sqrt(max(max(dot(r0, r0), dot(r1, r1)), dot(r2, r2)));
    return triangle_form_factor(p, n, v0, v1, v2, area_vector, radius);
}
#endif
