// SPDX-License-Identifier: GPL-3.0-or-later
// Reflection of a pixel's surface with the table of interface albedos bound.
#ifndef PASSES_REFLECTANCE
#define PASSES_REFLECTANCE
#include "lib/brdf.glsl"

layout(binding = ALBEDO_TABLE_UNIT) uniform sampler3D albedo_table;

// Share of the irradiance that `surface` sends diffusely towards the unit direction to_view, times pi.
vec3 diffuse_albedo(Surface surface, vec3 to_view) {
    return make_reflector(surface, to_view, albedo_table).diffuse;
}
#endif
