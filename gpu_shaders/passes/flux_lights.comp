// SPDX-License-Identifier: GPL-3.0-or-later
// Point lights on what one reflective shadow map shows: those of a frame's Halton points whose first coordinate falls
// into the map's part of [0, 1), warped by its flux (seed 004, 4.8).
#include "gpu_layout/VirtualPointLight"
#include "lib/flux_warp.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = LIGHT_BINDING) writeonly buffer Lights { VirtualPointLight lights[]; };
layout(binding = RSM_POSITION_UNIT) uniform sampler2D rsm_position;
layout(binding = RSM_NORMAL_UNIT) uniform sampler2D rsm_normal;
layout(binding = RSM_GEOMETRIC_NORMAL_UNIT) uniform sampler2D rsm_geometric_normal;
layout(binding = RSM_FLUX_UNIT) uniform sampler2D rsm_flux;

uniform uint count;
uniform uint first_index;   // in Halton's sequence, of the first light
uniform vec2 shift;
uniform vec2 part;          // of [0, 1), that this map is given; the parts of all maps leave nothing out
uniform ivec2 faces;        // columns and rows of tiles in the map
uniform int levels;
uniform float map_scale;    // with the offset takes a place of the map into the space of the lights
uniform vec3 map_offset;
uniform float light_flux;   // W, of every light, mean of the channels; in the space of the lights
uniform float map_flux;     // W, that a light would have in the space of the map
uniform float share;        // of the surfaces that this map shows, of all maps that show them

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) {
        return;
    }
    vec2 point = vec2(radical_inverse(first_index + i, 2u), radical_inverse(first_index + i, 3u));
    point = vec2(rotated(point.x, shift.x), rotated(point.y, shift.y));
    if (point.x < part.x || point.x >= part.y) {
        return;
    }
    point.x = clamp((point.x - part.x) / (part.y - part.x), 0.0, BELOW_1);
    ivec2 texel = warped_texel(rsm_flux, faces, levels, point);
    vec3 reflected = texelFetch(rsm_flux, texel, 0).rgb;
    float mean = (reflected.r + reflected.g + reflected.b) / 3.0;
    vec4 surface = texelFetch(rsm_normal, texel, 0);
    VirtualPointLight light;
    light.position = map_scale * texelFetch(rsm_position, texel, 0).xyz + map_offset;
    light.normal = surface.xyz;
    light.geometric_normal = texelFetch(rsm_geometric_normal, texel, 0).xyz;
    light.flux = mean > 0.0 ? reflected * (light_flux / mean) : vec3(0.0);
    // Of so many texels as the light stands for, never of less than one.
    float texels = mean > 0.0 ? max(map_flux / mean, 1.0) : 0.0;
    light.area = texels * surface.w * share * (map_scale * map_scale);
    lights[i] = light;
}
