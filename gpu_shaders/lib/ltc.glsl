// SPDX-License-Identifier: GPL-3.0-or-later
// What a GGX lobe receives from polygons, by linearly transformed cosines (Heitz, Dupuy, Hill and Neubelt 2016);
// float32 form of vlm_addon/core/ltc.py, which explains the fit.
//
// After the map a polygon's share of the lobe is a form factor, found as in lib/form_factor.glsl: clipped at the horizon,
// accurate for far lights and next to edges. Its plane is mapped from the stored one, so nothing cancels.
// Needs LTC_LEAST_COSINE, core/ltc.py's.
#ifndef LIB_LTC
#define LIB_LTC
#include "lib/brdf.glsl"
#include "lib/form_factor.glsl"

// Squared sizes in the lobe's space up to which a few points of a light stand for it, and from which on they do not.
#define LTC_POINT_SIZES vec2(0.1, 0.6)
// Squared size up to which its centroid does alone.
#define LTC_ONE_POINT_SIZE 0.02
// Share of a white wall's light that is left out.
#define LTC_LEAST_LOBE 2e-4
// Most by which the true lobe is taken to exceed the fitted one.
#define LTC_MOST_RATIO 3.0

struct LtcLobe {
    vec3 x_axis, y_axis, z_axis;    // unit, local space; z along the lobe
    vec2 inverse_widths;
    float tilt;
    float scale;                    // albedo of the lobe without Fresnel over the share of the fit above the surface
};

// What polygons fill of a lobe. share: cosine-weighted, in [0, 1]. toward: in the lobe's space to their middle as the
// lobe sees it; its length is twice their solid angle there while that is small.
struct LobeShare {
    float share;
    vec3 toward;
};

// Lean, widths over alpha and tilt. ltc_table: core/ltc.py's, filtered linearly.
vec4 lookup_ltc(sampler2D ltc_table, float alpha, float cos_view) {
    float cosine = clamp(cos_view, LTC_LEAST_COSINE, 1.0);
    vec2 coordinate = vec2(sqrt((1.0 - cosine) / (1.0 - LTC_LEAST_COSINE)), sqrt(clamp(alpha, 0.0, 1.0)));
    vec2 size = vec2(textureSize(ltc_table, 0));
    return textureLod(ltc_table, (coordinate * (size - 1.0) + 0.5) / size, 0.0);
}

// The lobe of a surface with unit `normal` seen from the unit direction to_view. fit: lookup_ltc's. albedo: of the lobe
// without Fresnel.
LtcLobe make_ltc_lobe(vec4 fit, float alpha, float albedo, vec3 normal, vec3 to_view) {
    float cos_view = clamp(dot(normal, to_view), 0.0, 1.0);
    vec3 side = to_view - cos_view * normal;
    float sin_view = length(side);
    // Seen along the normal, where lobes are round, any side does.
    vec3 other = abs(normal.x) < 0.5 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    side = sin_view > 1e-6 ? side / sin_view : normalize(cross(normal, other));
    vec2 lean = vec2(cos(fit.x), sin(fit.x));
    float cosine = cos_view * lean.x - sin_view * lean.y, sine = sin_view * lean.x + cos_view * lean.y;
    LtcLobe lobe;
    lobe.x_axis = cosine * side + sine * normal;
    lobe.y_axis = cross(normal, side);
    lobe.z_axis = cosine * normal - sine * side;
    vec2 widths = fit.yz * alpha;
    lobe.inverse_widths = 1.0 / widths;
    lobe.tilt = fit.w;
    // The surface's horizon in the lobe's space.
    vec2 horizon = vec2(widths.x * (sine + fit.w * cosine), cosine);
    float share = 0.5 + 0.5 * cosine * inversesqrt(max(dot(horizon, horizon), 1e-30));
    lobe.scale = albedo / max(share, 1e-3);
    return lobe;
}

vec3 to_lobe(LtcLobe lobe, vec3 v) {
    float x = dot(v, lobe.x_axis);
    return vec3(vec2(x, dot(v, lobe.y_axis)) * lobe.inverse_widths, dot(v, lobe.z_axis) - lobe.tilt * x);
}

// Of an area vector, m².
vec3 area_to_lobe(LtcLobe lobe, vec3 area) {
    vec2 inverse = lobe.inverse_widths;
    float z = dot(area, lobe.z_axis);
    return vec3((dot(area, lobe.x_axis) + lobe.tilt * z) * inverse.y, dot(area, lobe.y_axis) * inverse.x,
        z * inverse.x * inverse.y);
}

// Unit direction in local space; to_lobe of it is along v.
vec3 from_lobe(LtcLobe lobe, vec3 v) {
    vec2 across = v.xy / lobe.inverse_widths;
    vec3 direction = across.x * lobe.x_axis + across.y * lobe.y_axis + (v.z + lobe.tilt * across.x) * lobe.z_axis;
    return direction * inversesqrt(max(dot(direction, direction), 1e-37));
}

// Fitted GGX without Fresnel times the cosine of the light, 1/sr. direction: unit, above the surface.
float fitted_lobe(LtcLobe lobe, vec3 direction) {
    vec3 mapped = to_lobe(lobe, direction);
    float squared = dot(mapped, mapped);
    float inverse = lobe.inverse_widths.x / squared * (lobe.inverse_widths.y / squared);
    return lobe.scale * max(mapped.z, 0.0) * inverse * INVERSE_PI;
}

// edge_irradiance in all directions of the normal.
vec3 edge_vector(vec3 a, vec3 b, float a_length, float b_length, float cosine) {
    vec3 s = half_angle_normal(a, b, a_length, b_length, cosine);
    float u = dot(s, s);
    float acute = double_arctangent_ratio(u);
    float obtuse = FORM_FACTOR_PI * inversesqrt(max(u, 1e-37)) - acute;
    return (cosine >= 0.0 ? acute : obtuse) * s;
}

// a, b, c: from the point to the corners of a triangle above the surface, m. area_vector: m², of it, on the emitting
// side. facing: m³, -dot(area_vector, a) of the light that it is a part of, times its part.
LobeShare triangle_lobe_share(LtcLobe lobe, vec3 a, vec3 b, vec3 c, vec3 area_vector, float facing) {
    LobeShare nothing = LobeShare(0.0, vec3(0.0));
    vec3 b_side = to_lobe(lobe, b - a), c_side = to_lobe(lobe, c - a);
    vec3 middle = (b_side + c_side) * (1.0 / 3.0);
    vec3 b_arm = b_side - middle, c_arm = c_side - middle;
    float radius = sqrt(max(max(dot(middle, middle), dot(b_arm, b_arm)), dot(c_arm, c_arm)));
    float scale = unit_scale(radius);
    a = to_lobe(lobe, a) * scale;
    b = to_lobe(lobe, b) * scale;
    c = to_lobe(lobe, c) * scale;
    vec3 heights = vec3(a.z, b.z, c.z);
    // Written so that NaN, of lights without size, gives 0.
    if (!(facing > 0.0 && radius > 0.0) || max(max(heights.x, heights.y), heights.z) <= 0.0) {
        return nothing;
    }
    VisibleOutline outline = visible_outline(a, b, c, heights);
    vec3 q0 = outline.q0, q1 = outline.q1, q2 = outline.q2, q3 = outline.q3;
    vec4 squared = vec4(dot(q0, q0), dot(q1, q1), dot(q2, q2), dot(q3, q3));
    vec4 products = vec4(dot(q0, q1), dot(q1, q2), dot(q0, q2), dot(q0, q3));
    float far = FORM_FACTOR_FAR * scale * radius;
    if (squared.x > far * far) {
        float plane = facing * scale * lobe.inverse_widths.x * scale * lobe.inverse_widths.y * scale;
        vec3 mean = (outline.area_012 * (q0 + q1 + q2) + outline.area_023 * (q0 + q2 + q3)) * (1.0 / 3.0);
        float share = far_integrand(outline, squared, products) * plane * INVERSE_PI;
        return LobeShare(clamp(share, 0.0, 1.0), mean * (2.0 * plane / (squared.x * squared.x)));
    }
    vec4 lengths = sqrt(squared);
    vec3 toward = edge_vector(q1, q0, lengths.y, lengths.x, products.x)
        + edge_vector(q2, q1, lengths.z, lengths.y, products.y)
        + edge_vector(q0, q3, lengths.x, lengths.w, products.w);
    toward.z += horizon_arc(q2, q3, vec3(0.0, 0.0, 1.0));
    vec3 area = area_to_lobe(lobe, area_vector) * scale * scale;
    float share = clamp(toward.z * (0.5 / FORM_FACTOR_PI), 0.0, most_form_factor(vec3(0.0, 0.0, 1.0), area));
    return LobeShare(share, toward);
}

// The same of a whole light of which a part may be below the surface with unit normal n: clipped there first.
LobeShare clipped_lobe_share(LtcLobe lobe, vec3 n, vec3 a, vec3 b, vec3 c, vec3 area_vector) {
    vec3 heights = vec3(dot(n, a), dot(n, b), dot(n, c));
    float facing = -dot(area_vector, a);
    if (!(facing > 0.0) || max(max(heights.x, heights.y), heights.z) <= 0.0) {
        return LobeShare(0.0, vec3(0.0));
    }
    VisibleOutline outline = visible_outline(a, b, c, heights);
    float first = outline.area_012, second = outline.area_023;
    LobeShare sum = LobeShare(0.0, vec3(0.0));
    if (first > 0.0) {
        sum = triangle_lobe_share(lobe, outline.q0, outline.q1, outline.q2, first * area_vector, first * facing);
    }
    if (second > 0.0) {
        LobeShare other =
            triangle_lobe_share(lobe, outline.q0, outline.q2, outline.q3, second * area_vector, second * facing);
        sum = LobeShare(sum.share + other.share, sum.toward + other.toward);
    }
    return sum;
}

// GGX times the cosine of the light and Fresnel, 1/sr, as specular_reflection, but with all digits for sharp lobes.
// fresnel: lobe_fresnel's, with the gains of multiple scattering.
float true_lobe(Reflector reflector, vec3 normal, vec3 to_view, vec3 to_light, out vec3 fresnel) {
    vec3 half_vector = to_light + to_view;
    half_vector *= inversesqrt(max(dot(half_vector, half_vector), 1e-30));
    fresnel = lobe_fresnel(reflector, clamp(dot(to_view, half_vector), 0.0, 1.0));
    vec3 across = cross(normal, half_vector);
    float cos_light = max(dot(normal, to_light), 0.0), cos_view = max(dot(normal, to_view), 0.0);
    return ggx_lobe_of_sine(min(dot(across, across), 1.0), cos_light, cos_view, reflector.alpha);
}

// Radiance towards the eye of a lobe of which polygons of radiance 1 fill `found`. Fresnel is that of their middle as
// the lobe sees it; where they are small, so is the lobe, and less is left of the fit's error.
vec3 lobe_reflection(LtcLobe lobe, Reflector reflector, vec3 normal, vec3 to_view, LobeShare found) {
    vec3 to_light = from_lobe(lobe, found.toward), fresnel;
    float there = true_lobe(reflector, normal, to_view, to_light, fresnel);
    float ratio = min(there / max(fitted_lobe(lobe, to_light), 1e-30), LTC_MOST_RATIO);
    float spread = max(1.0 - length(found.toward) * INVERSE_PI, 0.0);
    return lobe.scale * found.share * mix(1.0, ratio, spread * spread) * fresnel;
}

// Angle around the mirror direction beyond which the lobe over pi is less than LTC_LEAST_LOBE, radians: of lights
// beyond it less is seen than that share of what a white wall shows of them. pi where there is none.
float lobe_reach(float alpha, float cos_view) {
    // G2 <= G1 of the eye leaves the distribution times this.
    float squared = alpha * alpha;
    float most = 0.5 / (cos_view + sqrt(cos_view * cos_view * (1.0 - squared) + squared));
    float sine_squared = alpha * (sqrt(most / LTC_LEAST_LOBE) - alpha) / max(1.0 - squared, 1e-6);
    // Light turns by twice as much as the half vector.
    return sine_squared >= 0.5 ? FORM_FACTOR_PI : 2.0 * asin(sqrt(max(sine_squared, 0.0)));
}

// Squared size of a light in the lobe's space, over its distance there. centre: from the point to its centroid. radius:
// of the light.
float size_in_lobe(LtcLobe lobe, vec3 centre, float radius) {
    vec3 mapped = to_lobe(lobe, centre);
    float stretched = radius * max(lobe.inverse_widths.x, lobe.inverse_widths.y);
    return stretched * stretched / max(dot(mapped, mapped), 1e-37);
}

// Most by which that exceeds the squared size over the distance in local space.
float most_stretch(LtcLobe lobe) {
    vec2 squared = lobe.inverse_widths * lobe.inverse_widths;
    // The map's smallest singular value, squared, of the plane of x and z.
    float sum = squared.x + lobe.tilt * lobe.tilt + 1.0;
    float least = 2.0 * squared.x / (sum + sqrt(max(sum * sum - 4.0 * squared.x, 0.0)));
    return max(squared.x, squared.y) / min(least, squared.y);
}

// How much a few points of a light stand for it: 1 where the lobe is smooth over it, 0 where it is large. size:
// size_in_lobe's.
float point_share(float size) {
    return 1.0 - smoothstep(LTC_POINT_SIZES.x, LTC_POINT_SIZES.y, size);
}

// Radiance towards the eye of a point of a light of radiance 1, as if all of its area were there.
vec3 point_reflection(Reflector reflector, vec3 normal, vec3 to_view, vec3 to_point, vec3 area_vector) {
    float inverse = inversesqrt(max(dot(to_point, to_point), 1e-37));
    vec3 to_light = to_point * inverse, fresnel;
    float solid_angle = max(-dot(area_vector, to_light) * inverse * inverse, 0.0);
    return solid_angle * true_lobe(reflector, normal, to_view, to_light, fresnel) * fresnel;
}

// The mean over three points, exact for quadratic functions. a, b, c: from the point to the corners.
vec3 points_reflection(Reflector reflector, vec3 normal, vec3 to_view, vec3 a, vec3 b, vec3 c, vec3 area_vector) {
    vec3 sixth = (a + b + c) * (1.0 / 6.0);
    return (point_reflection(reflector, normal, to_view, sixth + 0.5 * a, area_vector)
        + point_reflection(reflector, normal, to_view, sixth + 0.5 * b, area_vector)
        + point_reflection(reflector, normal, to_view, sixth + 0.5 * c, area_vector)) * (1.0 / 3.0);
}
#endif
