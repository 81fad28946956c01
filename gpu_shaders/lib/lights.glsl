// SPDX-License-Identifier: GPL-3.0-or-later
// Light of lamps without shadows, in Blender's units; float32 form of vlm_addon/core/lamps.py.
#ifndef LIB_LIGHTS
#define LIB_LIGHTS
#include "gpu_layout/Lamp"
#include "lib/form_factor.glsl"

// From this many radii on a cell of an area lamp is a point: the square of its inverse is the error.
#define AREA_LAMP_FAR 64.0
// W/m²: what a point lamp brings to a surface that touches it is unbounded, but float32 and the sums after it are not.
#define MOST_IRRADIANCE 1e30

// What reaches a point from one sample of a lamp.
struct LampRay {
    vec3 direction;     // unit, to the lamp's sample point
    vec3 irradiance;    // W/m², on a surface that faces the sample point
    float solid_angle;  // sr, of the part of the lamp that the sample stands for
};

// atan(y / x) for y >= 0, in [0, pi]; drivers' own are off by 1e-4.
float half_circle_arctangent(float y, float x) {
    float larger = max(y, abs(x));
    float t = larger > 0.0 ? min(y, abs(x)) / larger : 0.0;
    float angle = 0.5 * double_arctangent_ratio(t * t) * t;
    angle = y > abs(x) ? 0.5 * FORM_FACTOR_PI - angle : angle;
    return x >= 0.0 ? angle : FORM_FACTOR_PI - angle;
}

// Mean of max(0, n·l) over an evenly bright cone of directions (Snyder 1996). cosine: between n and the axis of the
// cone; sine: of half its angle. Equals the cosine while the whole cone is above the horizon.
float horizon_cosine(float cosine, float sine) {
    if (sine <= 0.0) {
        return max(cosine, 0.0);
    }
    if (cosine >= sine) {
        return cosine;
    }
    if (cosine <= -sine) {
        return 0.0;
    }
    float ratio = cosine / sine;
    if (sine < NARROW_CONE) {
        float root = sqrt(max(1.0 - ratio * ratio, 0.0));
        float angle = half_circle_arctangent(root, -ratio);
        float disk = ratio * angle + root * (2.0 + ratio * ratio) * (1.0 / 3.0);
        return sine * max(disk, 0.0) * (1.0 / FORM_FACTOR_PI);
    }
    float normal_sine = sqrt(max(1.0 - cosine * cosine, 1e-20));
    float x = sqrt(max(1.0 / (sine * sine) - 1.0, 0.0));
    float y = clamp(-x * cosine / normal_sine, -1.0, 1.0);
    float y_root = sqrt(max(1.0 - y * y, 0.0));
    float chord = normal_sine * y_root;
    float sum = (cosine * half_circle_arctangent(y_root, y) - x * chord) * sine * sine;
    // Both cancel where almost all of the cone is below the horizon.
    return max(sum + half_circle_arctangent(chord, x), 0.0) / (FORM_FACTOR_PI * sine * sine);
}

// Factor on the intensity of a spot along a direction that leaves it; need not be unit.
float spot_attenuation(Lamp lamp, vec3 direction) {
    vec3 local = vec3(
        dot(direction, lamp.x_axis) / lamp.spot_scale.x, dot(direction, lamp.y_axis) / lamp.spot_scale.y,
        -dot(direction, lamp.z_axis)
    );
    float cosine = local.z * inversesqrt(max(dot(local, local), 1e-30));
    float t = clamp((cosine - lamp.spot_cos_half) * lamp.spot_sharpness, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

vec3 lamp_corner(Lamp lamp, vec2 corner) {
    return lamp.position + corner.x * lamp.x_axis + corner.y * lamp.y_axis;
}

// Adds the part above the horizon of one edge from a to b, and keeps where the outline leaves and enters.
void add_clipped_edge(vec3 a, vec3 b, vec3 n, inout float sum, inout vec3 exit_point, inout vec3 entry_point) {
    float height_a = dot(n, a), height_b = dot(n, b);
    if (max(height_a, height_b) <= 0.0) {
        return;
    }
    if (height_a <= 0.0) {
        a = edge_at_horizon(a, b, height_a, height_b);
        entry_point = a;
    } else if (height_b <= 0.0) {
        b = edge_at_horizon(a, b, height_a, height_b);
        exit_point = b;
    }
    sum += edge_irradiance(b, a, n);
}

// Share of the hemisphere over p with normal n that an area lamp's cell fills, cosine-weighted. In units of about the
// cell's size, as in triangle_form_factor.
float cell_form_factor(Lamp lamp, vec3 p, vec3 n) {
    float scale = unit_scale(lamp.cell_radius);
    vec3 to_cell = (lamp_corner(lamp, lamp.cell_centre) - p) * scale;
    float distance_squared = dot(to_cell, to_cell);
    if (lamp.cell_area <= 0.0 || dot(lamp.z_axis, to_cell) <= 0.0) {
        return 0.0;
    }
    float far = AREA_LAMP_FAR * scale * lamp.cell_radius;
    if (distance_squared > far * far) {
        vec3 direction = normalize(to_cell);
        float facing = max(dot(n, direction), 0.0) * dot(lamp.z_axis, direction);
        return facing * (lamp.cell_area * scale * scale) / (FORM_FACTOR_PI * distance_squared);
    }
    vec2 corners[8] = vec2[8](
        lamp.corners_01.xy, lamp.corners_01.zw, lamp.corners_23.xy, lamp.corners_23.zw,
        lamp.corners_45.xy, lamp.corners_45.zw, lamp.corners_67.xy, lamp.corners_67.zw
    );
    vec3 exit_point = vec3(0.0), entry_point = vec3(0.0);
    vec3 start = (lamp_corner(lamp, corners[lamp.corner_count - 1]) - p) * scale;
    float sum = 0.0;
    for (int i = 0; i < lamp.corner_count; ++i) {
        vec3 end = (lamp_corner(lamp, corners[i]) - p) * scale;
        add_clipped_edge(start, end, n, sum, exit_point, entry_point);
        start = end;
    }
    if (dot(exit_point, exit_point) > 0.0) {
        sum += horizon_arc(exit_point, entry_point, n);
    }
    return clamp(sum * (0.5 / FORM_FACTOR_PI), 0.0, most_form_factor(n, -lamp.z_axis));
}

// Direction to the sample point of a lamp and what it brings to a surface that faces it.
LampRay lamp_ray(Lamp lamp, vec3 p) {
    float disk = FORM_FACTOR_PI * lamp.sample_weight;
    if (lamp.kind == LAMP_SUN) {
        float solid_angle = lamp.world_solid_angle > 0.0 ? lamp.world_solid_angle : disk * lamp.radius * lamp.radius;
        return LampRay(lamp.sample_position, lamp.intensity, solid_angle);
    }
    vec3 to_sample = lamp.sample_position - p;
    float distance_squared = max(dot(to_sample, to_sample), 1e-30);
    vec3 direction = to_sample * inversesqrt(distance_squared);
    if (lamp.kind == LAMP_AREA) {
        // The solid angle of a small piece, bounded where the point touches it.
        float facing = max(dot(lamp.z_axis, direction), 0.0) * lamp.cell_area;
        float share = facing / (FORM_FACTOR_PI * distance_squared + facing);
        return LampRay(direction, lamp.intensity * share, FORM_FACTOR_PI * share);
    }
    vec3 to_centre = lamp.position - p;
    float radius_squared = lamp.radius * lamp.radius;
    float reach = max(max(dot(to_centre, to_centre) + lamp.falloff_radius_squared, radius_squared), 1e-30);
    float attenuation = lamp.kind == LAMP_SPOT ? spot_attenuation(lamp, -direction) : 1.0;
    vec3 irradiance = min(lamp.intensity * (attenuation / reach), MOST_IRRADIANCE);
    return LampRay(direction, irradiance, disk * radius_squared / reach);
}

// Irradiance in W/m² at p with unit normal n, without shadows; averaged over the samples of a lamp it is exact.
vec3 lamp_irradiance(Lamp lamp, vec3 p, vec3 n) {
    if (lamp.kind == LAMP_AREA) {
        return lamp.intensity * cell_form_factor(lamp, p, n);
    }
    if (lamp.kind == LAMP_SUN) {
        return lamp.intensity * horizon_cosine(dot(n, lamp.position), lamp.radius);
    }
    vec3 to_centre = lamp.position - p;
    float distance_squared = max(dot(to_centre, to_centre), 1e-30);
    float radius_squared = lamp.radius * lamp.radius;
    float reach = max(distance_squared + lamp.falloff_radius_squared, radius_squared);
    float cosine = dot(n, to_centre) * inversesqrt(distance_squared);
    float facing = horizon_cosine(cosine, sqrt(radius_squared / reach)) / reach;
    if (lamp.kind == LAMP_SPOT) {
        facing *= spot_attenuation(lamp, p - lamp.sample_position);
    }
    return min(lamp.intensity * facing, MOST_IRRADIANCE);
}
#endif
