// SPDX-License-Identifier: GPL-3.0-or-later
// How simply a virtual light can be evaluated for a group of surface points: most lights are wholly above the horizon
// of all of them, many so far away that a mean over three points is exact to float32, some send nothing.
#ifndef LIB_LIGHT_CLASSES
#define LIB_LIGHT_CLASSES
#include "lib/form_factor.glsl"
#include "gpu_layout/PointGroup"

#define LIGHT_GIVES_NOTHING 0
#define LIGHT_IS_FAR 1
#define LIGHT_IS_WHOLE 2
#define LIGHT_IS_CLIPPED 3

// The class that holds for every point of the group. v0, v1, v2, area_vector, bounding_radius: of the light, as in
// triangle_form_factor.
int light_class(PointGroup group, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius) {
    float nearest_front = dot(area_vector, group.centre - v0) + dot(abs(area_vector), group.half_extent);
    if (nearest_front <= 0.0) {
        return LIGHT_GIVES_NOTHING;
    }
    vec3 along_axis = vec3(dot(group.axis, v0), dot(group.axis, v1), dot(group.axis, v2));
    float least_height = min(min(along_axis.x, along_axis.y), along_axis.z) - group.highest;
    float greatest_height = max(max(along_axis.x, along_axis.y), along_axis.z) - group.lowest;
    float group_radius = length(group.half_extent);
    float distance_to_centre = length((v0 + v1 + v2) * (1.0 / 3.0) - group.centre);
    // Heights over a normal that leans from the axis differ by at most this.
    float sin_spread = sqrt(max(1.0 - group.cos_spread * group.cos_spread, 0.0));
    float lean = group.cos_spread > 0.0 ? sin_spread * (distance_to_centre + group_radius + bounding_radius) : 1e30;
    if (group.cos_spread * greatest_height + lean <= 0.0) {
        return LIGHT_GIVES_NOTHING;
    }
    if (group.cos_spread * least_height - lean < 0.0) {
        return LIGHT_IS_CLIPPED;
    }
    bool is_far = distance_to_centre - group_radius > FORM_FACTOR_FAR * bounding_radius;
    return is_far ? LIGHT_IS_FAR : LIGHT_IS_WHOLE;
}

// triangle_form_factor where all corners are above the horizon and further than FORM_FACTOR_FAR radii.
float far_form_factor(vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector) {
    vec3 a = v0 - p, b = v1 - p, c = v2 - p;
    vec3 heights = vec3(dot(n, a), dot(n, b), dot(n, c));
    vec3 ab = a + b, bc = b + c, ca = c + a;
    float mean = midpoint_mean(heights + heights.yzx, 1.0 / vec3(dot(ab, ab), dot(bc, bc), dot(ca, ca)));
    return max(mean * dot(area_vector, a) * (-1.0 / FORM_FACTOR_PI), 0.0);
}

// triangle_form_factor where all corners are above the horizon and nearer than FORM_FACTOR_FAR radii.
float whole_form_factor(
    vec3 p, vec3 n, vec3 v0, vec3 v1, vec3 v2, vec3 area_vector, float bounding_radius
) {
    float scale = unit_scale(bounding_radius);
    vec3 a = (v0 - p) * scale, b = (v1 - p) * scale, c = (v2 - p) * scale;
    float sum = edge_irradiance(b, a, n) + edge_irradiance(c, b, n) + edge_irradiance(a, c, n);
    vec3 area = area_vector * scale * scale;
    return dot(area, a) < 0.0 ? clamp(sum * (0.5 / FORM_FACTOR_PI), 0.0, most_form_factor(n, area)) : 0.0;
}
#endif
