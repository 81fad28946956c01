// SPDX-License-Identifier: GPL-3.0-or-later
// What earlier pictures found for the surface that a pixel shows: where the last of them shows the same place with the
// same normal. Irradiance does not depend on who looks, so nothing else has to agree.
// HAS_MOTION: the place is where the surface was then. ACCUMULATES: a pixel whose place is seen by none of the four
// pixels around it asks the nine, a picture that shows the place much smaller tells nothing, and pixels are counted whose
// history is near by in the picture and seen alike: where a camera jumps in a room, all places may have been seen before,
// but not so.
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = HISTORY_IRRADIANCE_UNIT) uniform sampler2D history_irradiance;
layout(binding = HISTORY_PLACE_UNIT) uniform sampler2D history_place;   // its own local space; w: age, 0 for nothing
layout(binding = HISTORY_NORMAL_UNIT) uniform sampler2D history_normal;
layout(rgba32f, binding = 0) writeonly uniform image2D reprojected;
#ifdef ACCUMULATES
// And deviation of what pictures found; z, w: motion, pixels to the right and up to where the surface was.
layout(rgba32f, binding = 1) writeonly uniform image2D age;
#else
layout(r32f, binding = 1) writeonly uniform image2D age;                // pictures in the mean; 0 where there is none
#endif
#ifdef HAS_MOTION
layout(binding = PLACE_BEFORE_UNIT) uniform sampler2D place_before;     // w: whether there is one
layout(binding = NORMAL_BEFORE_UNIT) uniform sampler2D normal_before;
layout(binding = PLANE_BEFORE_UNIT) uniform sampler2D plane_before;
#endif
#ifdef ACCUMULATES
layout(std430, binding = COUNT_BINDING) buffer Counts { uint shown_pixels, near_pixels; };
#endif

uniform mat4 clip_from_history;
uniform float history_scale;        // with the offset takes a place into the history's space
uniform vec3 history_offset;
uniform float pixel_at_0, pixel_per_depth; // a pixel's size there: pixel_at_0 + pixel_per_depth x depth
uniform vec2 jitter_shift;          // pixels, from where that picture looked in its pixels to where this one does
uniform float most_age;
#ifdef ACCUMULATES
uniform float now_pixel_at_0, now_pixel_per_depth;  // of this picture, in its own units
uniform vec4 eye_before, eye_now;   // local places and 1, or directions towards a far eye and 0; each in its own space
uniform bool follows_eye;           // whether a history that is not seen alike counts for nothing
#endif

// Of float32 coordinates: what rounding may move a place by.
#define PLACE_ROUNDING 1e-6
// A place nearer to a pixel's middle than this share of the way to the next is taken for the middle: pictures of a camera
// that rests then do not blur.
#define SAME_PIXEL (1.0 / 256.0)

bool is_usable(vec4 value) {
    // As whole numbers: drivers may take any comparison with NaN for true.
    return all(lessThan(floatBitsToUint(value) & 0x7fffffffu, uvec4(floatBitsToUint(1e30))));
}

// Whether a texel of the history is of the surface at p, in the history's space, within `reach` of its plane.
bool is_of_surface(ivec2 texel, vec3 p, vec3 n, vec3 plane, float reach) {
    vec4 seen = texelFetch(history_place, texel, 0);
    // Pixels aside are elsewhere along the surface: only the distance from it tells another surface.
    return seen.w > 0.0 && abs(dot(seen.xyz - p, plane)) < reach
        && dot(texelFetch(history_normal, texel, 0).xyz, n) > SAME_NORMAL_COSINE
        && is_usable(texelFetch(history_irradiance, texel, 0));
}

// pictures: in the mean, 0 for no history. is_near: whether that is near by in the picture and seen alike. deviation: of
// what pictures found. motion: pixels to where the surface was in that picture, 0 where that is not known.
vec4 history_of(ivec2 pixel, out float pictures, out bool is_near, out float deviation, out vec2 motion) {
    pictures = 0.0;
    is_near = false;
    deviation = 0.0;
    motion = vec2(0.0);
#ifdef HAS_MOTION
    vec4 before = texelFetch(place_before, pixel, 0);
    if (before.w == 0.0) {
        return vec4(0.0);
    }
    vec3 p = history_scale * before.xyz + history_offset;
    vec3 n = texelFetch(normal_before, pixel, 0).xyz;
    vec3 plane = texelFetch(plane_before, pixel, 0).xyz;
#else
    vec3 p = history_scale * texelFetch(gbuffer_position, pixel, 0).xyz + history_offset;
    vec3 n = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 plane = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
#endif
    vec4 clip = clip_from_history * vec4(p, 1.0);
    ivec2 size = textureSize(history_place, 0);
    // From the middle of the first pixel; a place behind the camera, or far beside it, is in no picture.
    vec2 place = (clip.xy / clip.w * 0.5 + 0.5) * vec2(size) - 0.5 + jitter_shift;
    if (!(clip.w > 0.0 && all(greaterThan(place, vec2(-1.0))) && all(lessThan(place, vec2(size))))) {
        return vec4(0.0);
    }
#ifdef ACCUMULATES
    motion = place - vec2(pixel);
    float depth = texelFetch(gbuffer_position, pixel, 0).w;
    float pixel_now = history_scale * (now_pixel_at_0 + now_pixel_per_depth * depth);
    vec3 to_now = normalize(eye_now.xyz - eye_now.w * texelFetch(gbuffer_position, pixel, 0).xyz);
    vec3 to_before = normalize(eye_before.xyz - eye_before.w * p);
    bool is_alike = dot(to_now, to_before) > LEAST_VIEW_COSINE;
    if (pixel_at_0 + pixel_per_depth * clip.w > MOST_MAGNIFIED * pixel_now || (follows_eye && !is_alike)) {
        return vec4(0.0);
    }
    is_near = is_alike && length(motion) < LONGEST_WAY * float(size.x);
#endif
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
        if (is_of_surface(texel, p, n, plane, reach)) {
            sum += weight * texelFetch(history_irradiance, texel, 0);
            total += weight;
            deviation = max(deviation, texelFetch(history_normal, texel, 0).w);
            pictures = min(pictures, texelFetch(history_place, texel, 0).w);
        }
    }
#ifdef ACCUMULATES
    // Beside an edge pictures that look elsewhere in a pixel see now one surface, now the other.
    ivec2 nearest = ivec2(floor(place + 0.5));
    for (int k = 0; k < 9 && total == 0.0; ++k) {
        ivec2 texel = nearest + ivec2(k % 3, k / 3) - 1;
        bool is_inside = all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, size));
        if (is_inside && is_of_surface(texel, p, n, plane, reach)) {
            sum = texelFetch(history_irradiance, texel, 0);
            total = 1.0;
            deviation = texelFetch(history_normal, texel, 0).w;
            pictures = min(pictures, texelFetch(history_place, texel, 0).w);
        }
    }
#endif
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
    bool is_near = false;
    float deviation = 0.0;
    vec2 motion = vec2(0.0);
    vec4 found = vec4(0.0);
    if (most_age > 0.0 && pixel_shows_geometry(pixel)) {
        found = history_of(pixel, pictures, is_near, deviation, motion);
    }
#ifdef ACCUMULATES
    // One pixel of each 2 x 2 tells the share as well.
    if ((pixel.x & 1) == 0 && (pixel.y & 1) == 0 && pixel_shows_geometry(pixel)) {
        atomicAdd(shown_pixels, 1u);
        atomicAdd(near_pixels, pictures > 0.0 && is_near ? 1u : 0u);
    }
#endif
    imageStore(reprojected, pixel, found);
    imageStore(age, pixel, vec4(pictures, deviation, motion));
}
