// SPDX-License-Identifier: GPL-3.0-or-later
// One face of a reflective shadow map, from the G-buffer of what the lamp sees through it.
#include "passes/gbuffer_samplers.glsl"
#include "lib/rsm.glsl"

// Cosine of a surface that the lamp grazes: bounds the area that its texel covers.
#define GRAZING_COSINE 1e-3

layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(std430, binding = RESULT_BINDING) buffer Brightest { uint brightest[3]; }; // bits of floats from 0, W/m²
layout(binding = ALBEDO_TABLE_UNIT) uniform sampler3D albedo_table;

uniform ivec2 tile_corner;      // of the face in the map, texels
uniform vec2 extent, centre;    // half the face and its middle, on the plane at distance 1; for a sun in m
uniform float side;             // texels

layout(location = 0) out vec4 out_position; // m, from the local origin; w: depth along the face's axis, m
layout(location = 1) out vec4 out_normal;   // unit, on the lamp's side; w: surface in the texel, m²
layout(location = 2) out vec4 out_flux;     // W; w: the texel's part of the map: sr of a cube, share of a single tile
layout(location = 3) out vec4 out_geometric_normal; // unit, on the lamp's side

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - tile_corner;
    Lamp lamp = lamps[0];
    bool is_sun = lamp.kind == LAMP_SUN;
    vec2 size = 2.0 * extent / side;
    vec2 place = (vec2(texel) + 0.5) * size - extent + centre;
    float measure = is_sun ? size.x * size.y : piece_solid_angle(place, size);
    out_flux = vec4(0.0, 0.0, 0.0, lamp.shadow_kind == SHADOW_CUBE ? measure : 1.0 / (side * side));
    out_position = out_normal = out_geometric_normal = vec4(0.0);
    // The clockwise side is the inside of a solid: what a lamp in there lights does not shine out.
    if (!pixel_shows_geometry(texel) || seen_from_back(texelFetch(gbuffer_ids, texel, 0))) {
        return;
    }
    Surface surface = fetch_surface(texel);
    vec3 to_lamp = is_sun ? lamp.sample_position : lamp.sample_position - surface.position;
    float distance_squared = dot(to_lamp, to_lamp);
    float cosine = dot(surface.geometric_normal, to_lamp) * inversesqrt(max(distance_squared, 1e-30));
    float area = (is_sun ? measure : measure * distance_squared) / max(cosine, GRAZING_COSINE);
    vec3 received = lamp_irradiance(lamp, surface.position, surface.geometric_normal) * (lamp.sample_weight * area);
    vec3 flux = diffuse_reflectance(surface, albedo_table) * received;
    out_position = vec4(surface.position, surface.depth);
    out_normal = vec4(surface.shading_normal, area);
    out_geometric_normal = vec4(surface.geometric_normal, 0.0);
    out_flux.rgb = flux;
    vec3 radiosity = flux / max(area, 1e-30);
    for (int channel = 0; channel < 3; ++channel) {
        atomicMax(brightest[channel], floatBitsToUint(radiosity[channel]));
    }
}
