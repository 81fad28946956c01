// SPDX-License-Identifier: GPL-3.0-or-later
// The one ray that a pixel's specular lobe sends out in a picture: the same for every pass that follows it.
#ifndef PASSES_REFLECTION_RAY
#define PASSES_REFLECTION_RAY
#include "passes/gbuffer_samplers.glsl"
#include "passes/reflectance.glsl"
#include "lib/spread_pattern.glsl"
#include "lib/visible_normals.glsl"

uniform vec3 camera_position;       // m, from the local origin
uniform vec3 camera_backward;       // unit
uniform bool is_orthographic;
uniform uint sample_index;
uniform vec2 roughness_fade;        // from which roughness on rays count less, and from which none is sent

struct ReflectionRay {
    vec3 origin;    // m, from the local origin
    vec3 direction; // unit
    vec3 weight;    // of the radiance that comes along it in what the pixel sends to the eye
    float share;    // in [0, 1]: what the roughness leaves of the effect; 0 for no ray
};

ReflectionRay reflection_ray(ivec2 pixel) {
    ReflectionRay none = ReflectionRay(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    if (!pixel_shows_geometry(pixel)) {
        return none;
    }
    Surface surface = fetch_surface(pixel);
    float share = roughness_fade.y > roughness_fade.x
        ? 1.0 - smoothstep(roughness_fade.x, roughness_fade.y, surface.roughness)
        : float(surface.roughness <= roughness_fade.x);
    vec3 to_eye = is_orthographic ? camera_backward : normalize(camera_position - surface.position);
    Reflector reflector = make_reflector(surface, to_eye, albedo_table);
    vec3 normal = surface.shading_normal;
    float cos_view = dot(normal, to_eye);
    if (reflector.alpha == 0.0 || !(share > 0.0) || !(cos_view > 0.0)) {
        return none;
    }
    vec3 facet = normal;
    if (reflector.alpha > LEAST_ALPHA) {
        vec2 numbers = spread_pattern(uvec2(pixel), 0u, sample_index);
        facet = visible_normal(normal, to_eye, reflector.alpha, numbers);
    }
    vec3 direction = normalize(reflect(-to_eye, facet));
    float kept = shadowing_share(dot(normal, direction), cos_view, reflector.alpha);
    if (!(kept > 0.0) || !(dot(surface.geometric_normal, direction) > 0.0)) {
        return none;
    }
    vec3 weight = kept * lobe_fresnel(reflector, clamp(dot(to_eye, facet), 0.0, 1.0));
    return ReflectionRay(surface.position, direction, weight, share);
}

// W/(m² sr): what is brighter is not light but an overflow.
#define MOST_RADIANCE 1e30

// What is a number and not less than 0, else 0.
vec3 sound_radiance(vec3 radiance) {
    return vec3(
        radiance.r >= 0.0 && radiance.r <= MOST_RADIANCE ? radiance.r : 0.0,
        radiance.g >= 0.0 && radiance.g <= MOST_RADIANCE ? radiance.g : 0.0,
        radiance.b >= 0.0 && radiance.b <= MOST_RADIANCE ? radiance.b : 0.0
    );
}
#endif
