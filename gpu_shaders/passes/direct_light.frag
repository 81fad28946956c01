// SPDX-License-Identifier: GPL-3.0-or-later
// Light of one sample of one lamp that each pixel sends to the eye, added to that of the other lamps.
#include "passes/gbuffer_samplers.glsl"
#include "passes/reflectance.glsl"
#include "lib/lights.glsl"
#include "lib/shadow.glsl"

// Between neighbouring facets of a curved surface, radians; the normal of each is exact.
#define FACET_TILT 0.05

layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(binding = SHADOW_MAP_UNIT) uniform sampler2D shadow_map;

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform float weight;           // of this sample of the lamp in this picture
uniform vec2 distances;         // from the eye, outer and inner, between which this shadow map counts, m; 0 for no end

layout(location = 0) out vec4 out_radiance; // W/(m² sr)

// Share of this shadow map among those of the windows around the eye; over all of them they sum to 1.
float window_share(vec3 position) {
    float from_eye = distance(position, camera_position);
    float inside = distances.x > 0.0 ? 1.0 - smoothstep(WINDOW_FADE * distances.x, distances.x, from_eye) : 1.0;
    float beyond = distances.y > 0.0 ? smoothstep(WINDOW_FADE * distances.y, distances.y, from_eye) : 1.0;
    return inside * beyond;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_radiance = vec4(0.0);
    vec3 geometric_normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    if (!shows_geometry(geometric_normal)) {
        return;
    }
    Lamp lamp = lamps[0];
    // Known when the shader is compiled: software renderers would run the branches of all kinds.
    lamp.kind = LAMP_KIND;
    lamp.shadow_kind = SHADOW_KIND;
#if !HAS_RADIUS
    lamp.radius = lamp.falloff_radius_squared = 0.0;
#endif
    vec3 position = texelFetch(gbuffer_position, pixel, 0).xyz;
    float share = weight * window_share(position);
    if (share <= 0.0) {
        return;
    }
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 irradiance = lamp_irradiance(lamp, position, normal);
    LampRay ray = lamp_ray(lamp, position);
#if HAS_HIGHLIGHTS
    vec3 specular_irradiance = dot(normal, ray.direction) > 0.0 ? ray.irradiance : vec3(0.0);
#else
    const vec3 specular_irradiance = vec3(0.0);
#endif
    if (max(max(irradiance.r, irradiance.g), irradiance.b) <= 0.0 && specular_irradiance == vec3(0.0)) {
        return;
    }
    float lit = lit_share(shadow_map, lamp, position, geometric_normal, FACET_TILT);
    if (lit <= 0.0) {
        return;
    }
    Surface surface = fetch_surface(pixel);
    vec3 to_camera = is_orthographic ? camera_backward : normalize(camera_position - position);
    Reflector reflector = make_reflector(surface, to_camera, albedo_table);
    vec3 radiance = reflector.diffuse * INVERSE_PI * irradiance;
#if HAS_HIGHLIGHTS
    reflector.alpha = widened_alpha(reflector.alpha, ray.solid_angle);
    radiance += specular_reflection(reflector, normal, ray.direction, to_camera) * specular_irradiance;
#endif
    out_radiance = vec4(share * lit * radiance, 0.0);
}
