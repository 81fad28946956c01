// SPDX-License-Identifier: GPL-3.0-or-later
// Light that each pixel's specular lobe sends to the eye, of what its ray and those of the pixels around have found: each
// counts by what the pixel's own lobe reflects from there, over how densely rays were sent there (ratio estimator:
// Stachowiak 2015; Heitz, Hill and McGuire 2018).
#include "passes/reflection_ray.glsl"
#include "passes/sound_radiance.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = RAYS_UNIT) uniform sampler2D rays;         // unit direction, w: its density in 1/sr; 0 for no ray
layout(binding = INCOMING_UNIT) uniform sampler2D incoming; // W/(m² sr) along it, times w: how sure that is, in [0, 1]
layout(binding = DISTANCES_UNIT) uniform sampler2D distances; // m to what sends it, in DISTANCE_CHANNEL
layout(rgba32f, binding = 0) writeonly uniform image2D reflected; // W/(m² sr), times w: how sure it is

uniform ivec2 first;        // of the 4 x 4 pixels, from the pixel itself
uniform vec2 pixel_size;    // m: at depth 0, and for each m of depth

// Roughness squared below which the ray of another pixel says nothing, and float32 cannot tell how much.
#define MIRROR_ALPHA 3e-3
// Pixels' sizes off a surface's plane: what is farther off is not of one surface.
#define OFF_PLANE 2.0
// Of a ray that the pixel's own lobe would send far more often.
#define MOST_WEIGHT 10.0

// What the ray of another pixel found, weighed for the pixel of `lobe`. found: rgb and confidence; returns the weight.
float weigh_ray(ivec2 other, Lobe lobe, out vec4 found) {
    found = vec4(0.0);
    vec4 ray = texelFetch(rays, other, 0);
    vec3 apart = texelFetch(gbuffer_position, other, 0).xyz - lobe.surface.position;
    float size = pixel_size.x + pixel_size.y * lobe.surface.depth;
    if (!(ray.w > 0.0) || !(abs(dot(apart, lobe.surface.geometric_normal)) <= OFF_PLANE * size)) {
        return 0.0;
    }
    vec4 light = texelFetch(incoming, other, 0);
    vec3 direction = ray.xyz;
    if (light.w > 0.0) {
        direction = normalize(apart + texelFetch(distances, other, 0)[DISTANCE_CHANNEL] * ray.xyz);
    }
    vec3 normal = lobe.surface.shading_normal, half_vector = normalize(direction + lobe.to_eye);
    float cos_light = dot(normal, direction), cos_half = clamp(dot(normal, half_vector), 0.0, 1.0);
    if (!(cos_light > 0.0)) {
        return 0.0;
    }
    vec3 reflects = lobe_fresnel(lobe.reflector, clamp(dot(lobe.to_eye, half_vector), 0.0, 1.0));
    found = vec4(reflects * light.rgb, light.w);
    return min(ggx_lobe(cos_half, cos_light, lobe.cos_view, lobe.reflector.alpha) / ray.w, MOST_WEIGHT);
}

vec4 resolved(ivec2 pixel) {
    Lobe lobe = pixel_lobe(pixel);
    if (!(lobe.share > 0.0)) {
        return vec4(0.0);
    }
    float weights = 0.0;
    vec4 sum = vec4(0.0);
    bool is_mirror = lobe.reflector.alpha < MIRROR_ALPHA;
    ivec2 last = textureSize(gbuffer_position, 0) - 1;
    for (int i = 0; i < 16; ++i) {
        ivec2 other = is_mirror ? pixel : pixel + first + ivec2(i & 3, i >> 2);
        if (all(greaterThanEqual(other, ivec2(0))) && all(lessThanEqual(other, last))) {
            vec4 found;
            float weight = weigh_ray(other, lobe, found);
            weights += weight;
            sum += weight * found;
        }
        if (is_mirror) {
            break;
        }
    }
    if (!(weights > 0.0)) {
        return vec4(0.0);
    }
    float albedo = lookup_albedo(albedo_table, 0.0, lobe.cos_view, lobe.surface.roughness).y;
    vec4 mean = sum * (lobe.share / weights) * vec4(vec3(albedo), 1.0);
    return all(are_sound(mean)) ? vec4(mean.rgb, min(mean.w, 1.0)) : vec4(0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(reflected)))) {
        imageStore(reflected, pixel, resolved(pixel));
    }
}
