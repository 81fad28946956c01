// SPDX-License-Identifier: GPL-3.0-or-later
// What falls on, and leaves, the surfaces of one picture, as far as its passes ran: those that did not are not sampled.
#ifndef PASSES_PICTURE_LIGHT
#define PASSES_PICTURE_LIGHT
#include "passes/gbuffer_samplers.glsl"
#include "passes/reflectance.glsl"

#ifdef DIRECT_UNIT
layout(binding = DIRECT_UNIT) uniform sampler2D direct_light;       // W/(m² sr)
#endif
#ifdef IRRADIANCE_UNIT
layout(binding = IRRADIANCE_UNIT) uniform sampler2D irradiance;     // W/m²
#endif
#ifdef OPENNESS_UNIT
layout(binding = OPENNESS_UNIT) uniform sampler2D openness;         // share of the irradiance that is not occluded
#endif
#ifdef SPECULAR_UNIT
layout(binding = SPECULAR_UNIT) uniform sampler2D specular_light;   // W/(m² sr)
#endif

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;

vec3 direct_radiance(ivec2 pixel) {
#ifdef DIRECT_UNIT
    return texelFetch(direct_light, pixel, 0).rgb;
#else
    return vec3(0.0);
#endif
}

// Indirect irradiance before ambient occlusion.
vec3 received(ivec2 pixel) {
#ifdef IRRADIANCE_UNIT
    return texelFetch(irradiance, pixel, 0).rgb;
#else
    return vec3(0.0);
#endif
}

// What the surface of a pixel sends to the eye of its indirect irradiance.
vec3 indirect_radiance(ivec2 pixel, Surface surface) {
#ifdef IRRADIANCE_UNIT
    vec3 to_camera = is_orthographic ? camera_backward : normalize(camera_position - surface.position);
    vec3 radiance = diffuse_albedo(surface, to_camera) * received(pixel) * INVERSE_PI;
#ifdef OPENNESS_UNIT
    radiance *= texelFetch(openness, pixel, 0).r;
#endif
    return radiance;
#else
    return vec3(0.0);
#endif
}

vec3 specular_radiance(ivec2 pixel) {
#ifdef SPECULAR_UNIT
    return texelFetch(specular_light, pixel, 0).rgb;
#else
    return vec3(0.0);
#endif
}
#endif
