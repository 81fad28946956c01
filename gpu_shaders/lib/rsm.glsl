// SPDX-License-Identifier: GPL-3.0-or-later
// Reflective shadow maps: what the texels hold, and discs of places in them (seed 003, 4.2.2 and 4.3.3).
#ifndef LIB_RSM
#define LIB_RSM
#include "lib/brdf.glsl"
#include "lib/lights.glsl"
#include "lib/shadow.glsl"

// Solid angle in sr of a small piece of a plane at distance 1. place: its centre from the foot of the plane; size: its
// sides.
float piece_solid_angle(vec2 place, vec2 size) {
    float squared = 1.0 + dot(place, place);
    return size.x * size.y / (squared * sqrt(squared));
}

// Share of the irradiance that `surface` sends out diffusely, averaged over views; core/brdf.py, diffuse_reflectance.
vec3 diffuse_reflectance(Surface surface, sampler3D albedo_table) {
#ifdef ALL_DIFFUSE
    return surface.base_color;
#else
    if (surface.model != MODEL_PRINCIPLED) {
        return surface.base_color;
    }
    float f0 = f0_from_ior(specular_ior(surface.ior, surface.specular_ior_level));
    float layer_albedo = lookup_albedo(albedo_table, f0, 1.0, surface.roughness).w;
    return surface.base_color * ((1.0 - surface.metallic) * max(1.0 - layer_albedo, 0.0));
#endif
}

// Where p projects into a map of one tile, in [0, 1]²: the nearest place in the map where it lies beside it.
vec2 map_place(Lamp lamp, vec3 p) {
    vec3 q = shadow_point(lamp, p, vec3(0.0)).position;
    vec2 plane = lamp.shadow_kind == SHADOW_PARALLEL ? q.xy : q.xy / max(q.z, 1e-6 * (abs(q.x) + abs(q.y)) + 1e-30);
    return clamp((plane - lamp.shadow_centre) / lamp.shadow_extent * 0.5 + 0.5, 0.0, 1.0);
}

// Radius of the disc around `place` that covers all of a map of one tile.
float covering_radius(vec2 place) {
    return length(max(place, 1.0 - place));
}

// Columns x, y, z of a frame whose z is `axis`, unit (Duff et al. 2017).
mat3 frame_of(vec3 axis) {
    float side = axis.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (side + axis.z);
    float b = axis.x * axis.y * a;
    vec3 tangent = vec3(1.0 + side * axis.x * axis.x * a, side * b, -side * axis.x);
    return mat3(tangent, vec3(b, side + axis.y * axis.y * a, -axis.y), axis);
}

// Unit direction to a place in the equal-area picture of the sphere around the frame's z (Lambert's azimuthal
// projection), in which the whole sphere is the unit disc. disc: within it.
vec3 sphere_direction(mat3 frame, vec2 disc) {
    float squared = min(dot(disc, disc), 1.0);
    return frame * vec3(2.0 * sqrt(1.0 - squared) * disc, 1.0 - 2.0 * squared);
}

// Texel of the map of a cube, `side` texels a face, that shows a direction from the lamp, in the lamp's own frame.
ivec2 cube_texel(vec3 direction, int side) {
    Lamp lamp;
    lamp.shadow_kind = SHADOW_CUBE;
    lamp.shadow_origin = vec3(0.0);
    lamp.x_axis = vec3(1.0, 0.0, 0.0);
    lamp.y_axis = vec3(0.0, 1.0, 0.0);
    lamp.z_axis = vec3(0.0, 0.0, 1.0);
    ShadowPoint place = shadow_point(lamp, direction, vec3(0.0));
    vec2 uv = place.position.xy / place.position.z * 0.5 + 0.5;
    return ivec2(place.tile) * side + clamp(ivec2(uv * float(side)), ivec2(0), ivec2(side - 1));
}
#endif
