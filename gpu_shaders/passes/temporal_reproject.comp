// SPDX-License-Identifier: GPL-3.0-or-later
// What earlier pictures found for the surface that a pixel shows: where the last of them shows the same place with the
// same normal. Irradiance does not depend on who looks, so nothing else has to agree.
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = HISTORY_IRRADIANCE_UNIT) uniform sampler2D history_irradiance;
layout(binding = HISTORY_PLACE_UNIT) uniform sampler2D history_place;   // its own local space; w: age, 0 for nothing
layout(binding = HISTORY_NORMAL_UNIT) uniform sampler2D history_normal;
layout(rgba32f, binding = 0) writeonly uniform image2D reprojected;
layout(r32f, binding = 1) writeonly uniform image2D age;                // pictures in the mean; 0 where there is none

uniform mat4 clip_from_history;
uniform float history_scale;        // with the offset takes a place into the history's space
uniform vec3 history_offset;
uniform float pixel_at_0, pixel_per_depth; // a pixel's size there: pixel_at_0 + pixel_per_depth x depth
uniform float most_age;

// Of float32 coordinates: what rounding may move a place by.
#define PLACE_ROUNDING 1e-6
// A place nearer to a pixel's middle than this share of the way to the next is taken for the middle: pictures of a camera
// that rests then do not blur.
#define SAME_PIXEL (1.0 / 256.0)

bool is_usable(vec4 value) {
    // As whole numbers: drivers may take any comparison with NaN for true.
    return all(lessThan(floatBitsToUint(value) & 0x7fffffffu, uvec4(floatBitsToUint(1e30))));
}

vec4 history_of(ivec2 pixel, out float pictures) {
    pictures = 0.0;
    vec3 p = history_scale * texelFetch(gbuffer_position, pixel, 0).xyz + history_offset;
    vec3 n = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 plane = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    vec4 clip = clip_from_history * vec4(p, 1.0);
    ivec2 size = textureSize(history_place, 0);
    // From the middle of the first pixel; a place behind the camera, or far beside it, is in no picture.
    vec2 place = (clip.xy / clip.w * 0.5 + 0.5) * vec2(size) - 0.5;
    if (!(clip.w > 0.0 && all(greaterThan(place, vec2(-1.0))) && all(lessThan(place, vec2(size))))) {
        return vec4(0.0);
    }
    vec2 within = fract(place + SAME_PIXEL);
    ivec2 corner = ivec2(floor(place + SAME_PIXEL));
    within = mix(max(within - SAME_PIXEL, 0.0), vec2(0.0), lessThan(within, vec2(2.0 * SAME_PIXEL)));
    float reach = pixel_at_0 + pixel_per_depth * clip.w + PLACE_ROUNDING * (1.0 + length(p));
    vec4 sum = vec4(0.0);
    float total = 0.0;
    pictures = most_age;
    for (int k = 0; k < 4; ++k) {
        ivec2 step = ivec2(k & 1, k >> 1);
        ivec2 texel = corner + step;
        float weight = (step.x == 1 ? within.x : 1.0 - within.x) * (step.y == 1 ? within.y : 1.0 - within.y);
        if (weight == 0.0 || any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, size))) {
            continue;
        }
        vec4 seen = texelFetch(history_place, texel, 0);
        vec4 value = texelFetch(history_irradiance, texel, 0);
        // Pixels aside are elsewhere along the surface: only the distance from it tells another surface.
        bool is_same = seen.w > 0.0 && abs(dot(seen.xyz - p, plane)) < reach
            && dot(texelFetch(history_normal, texel, 0).xyz, n) > SAME_NORMAL_COSINE;
        if (is_same && is_usable(value)) {
            sum += weight * value;
            total += weight;
            pictures = min(pictures, seen.w);
        }
    }
    if (total == 0.0) {
        pictures = 0.0;
        return vec4(0.0);
    }
    return sum / total;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(age)))) {
        return;
    }
    float pictures = 0.0;
    vec4 found = vec4(0.0);
    if (most_age > 0.0 && pixel_shows_geometry(pixel)) {
        found = history_of(pixel, pictures);
    }
    imageStore(reprojected, pixel, found);
    imageStore(age, pixel, vec4(pictures));
}
