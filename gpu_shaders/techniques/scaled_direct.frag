// SPDX-License-Identifier: GPL-3.0-or-later
// What scaling adds to one sample of one lamp's direct light (seed 000, eq. 5.2): a share of it without shadows, less
// a share of it with them.
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
uniform float without_shadow;   // share of the direct light that is added
uniform float with_shadow;      // share of the shadowed direct light that is taken away; not larger

layout(location = 0) out vec4 out_irradiance;   // W/m²
layout(location = 1) out vec4 out_specular;     // W/(m² sr)

// Share of this shadow map among those of the windows around the eye; over all of them they sum to 1.
float window_share(float from_eye) {
    float inside = distances.x > 0.0 ? 1.0 - smoothstep(WINDOW_FADE * distances.x, distances.x, from_eye) : 1.0;
    float beyond = distances.y > 0.0 ? smoothstep(WINDOW_FADE * distances.y, distances.y, from_eye) : 1.0;
    return inside * beyond;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_irradiance = out_specular = vec4(0.0);
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
    float share = weight * window_share(distance(position, camera_position));
    if (share <= 0.0) {
        return;
    }
    Surface surface = fetch_surface(pixel);
    vec3 normal = surface.shading_normal;
    vec3 to_camera = is_orthographic ? camera_backward : normalize(camera_position - position);
    LampRay ray = lamp_ray(lamp, position);
    Reflector reflector = make_reflector(surface, to_camera, albedo_table);
    reflector.alpha = widened_alpha(reflector.alpha, ray.solid_angle);
    float lit = lit_share(shadow_map, lamp, position, geometric_normal, FACET_TILT);
    float added = share * max(without_shadow - with_shadow * lit, 0.0);
    out_irradiance.rgb = added * lamp_irradiance(lamp, position, normal);
    out_specular.rgb = added * specular_reflection(reflector, normal, ray.direction, to_camera) * ray.irradiance;
}
