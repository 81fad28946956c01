// SPDX-License-Identifier: GPL-3.0-or-later
// What passes about the rays of specular lobes know of a pixel.
#ifndef PASSES_REFLECTION_RAY
#define PASSES_REFLECTION_RAY
#include "passes/gbuffer_samplers.glsl"
#include "passes/reflectance.glsl"
#include "lib/visible_normals.glsl"

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform vec2 roughness_fade;    // from which roughness on rays count less, and from which none is sent

struct Lobe {
    Surface surface;
    vec3 to_eye;        // unit
    Reflector reflector;
    float cos_view;
    float share;        // in [0, 1]: what the roughness leaves of the effect; 0 for no ray
};

Lobe pixel_lobe(ivec2 pixel) {
    Lobe lobe;
    lobe.surface = fetch_surface(pixel);
    vec3 to_camera = camera_position - lobe.surface.position;
    lobe.to_eye = is_orthographic ? camera_backward : to_camera * inversesqrt(max(dot(to_camera, to_camera), 1e-30));
    lobe.reflector = make_reflector(lobe.surface, lobe.to_eye, albedo_table);
    lobe.cos_view = dot(lobe.surface.shading_normal, lobe.to_eye);
    float roughness = lobe.surface.roughness;
    lobe.share = roughness_fade.y > roughness_fade.x ? 1.0 - smoothstep(roughness_fade.x, roughness_fade.y, roughness)
        : float(roughness <= roughness_fade.x);
    if (!pixel_shows_geometry(pixel) || lobe.reflector.alpha == 0.0 || !(lobe.cos_view > 0.0) || !(lobe.share > 0.0)) {
        lobe.share = 0.0;
    }
    return lobe;
}
#endif
