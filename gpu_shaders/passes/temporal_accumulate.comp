// SPDX-License-Identifier: GPL-3.0-or-later
// The mean of what this picture found and what earlier ones did, kept for the next. CLAMPS: where something changes,
// earlier ones are held near to what the neighbourhood has now (variance clipping: Salvi 2016).
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = FOUND_UNIT) uniform sampler2D found_now;
layout(binding = REPROJECTED_UNIT) uniform sampler2D reprojected;
layout(binding = AGE_UNIT) uniform sampler2D age;  // and deviation of what earlier pictures found
layout(std430, binding = COUNT_BINDING) readonly buffer Counts { uint shown_pixels, near_pixels; };
layout(rgba32f, binding = 0) writeonly uniform image2D history_value;
layout(rgba32f, binding = 1) writeonly uniform image2D history_place;
layout(rgba16f, binding = 2) writeonly uniform image2D history_normal;   // w: deviation, largest of the channels
layout(rgba32f, binding = 3) writeonly uniform image2D result;

uniform float most_age;
uniform float pictures_of_frame; // so far, with this one
uniform float mirror_age;       // most pictures of a history where a surface is ROUGH, none at a MIRROR; below 0: any
uniform float cut_share;        // of the surface's pixels must have a history near by, or none counts
#ifdef CLAMPS
uniform float clamp_width;      // standard deviations
uniform float pixel_at_0, pixel_per_depth; // a pixel's size: pixel_at_0 + pixel_per_depth x depth
#endif

#define REACH 2                 // pixels to each side that are the neighbourhood
#define LARGEST_HALF 6e4
#define LEAST_NEIGHBOURS 4      // of fewer, mean and deviation say nothing

bool is_usable(vec4 value) {
    // As whole numbers: drivers may take any comparison with NaN for true.
    return all(lessThan(floatBitsToUint(value) & 0x7fffffffu, uvec4(floatBitsToUint(1e17))));
}

float largest(vec4 v) {
    return max(max(v.x, v.y), max(v.z, v.w));
}

#ifdef CLAMPS
bool is_same_surface(ivec2 pixel, ivec2 other) {
    vec4 here = texelFetch(gbuffer_position, pixel, 0);
    vec3 between = texelFetch(gbuffer_position, other, 0).xyz - here.xyz;
    vec3 plane = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    float reach = pixel_at_0 + pixel_per_depth * here.w;
    return pixel_shows_geometry(other) && abs(dot(between, plane)) < reach
        && dot(texelFetch(gbuffer_shading_normal, other, 0).xyz, texelFetch(gbuffer_shading_normal, pixel, 0).xyz)
            > SAME_NORMAL_COSINE;
}

// `earlier` held within clamp_width standard deviations of the mean of what pixels of one surface found around `pixel`.
// deviation: of the pixel over time, which counts where the pixels around happen to agree: of rare events most
// neighbourhoods see none. Where `earlier` is changed, that of the neighbourhood takes its place.
vec4 held(ivec2 pixel, vec4 earlier, inout float deviation) {
    vec4 sum = vec4(0.0);
    vec4 squares = vec4(0.0);
    float count = 0.0;
    vec4 origin = texelFetch(found_now, pixel, 0);
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            ivec2 other = pixel + ivec2(x, y);
            bool is_inside = all(greaterThanEqual(other, ivec2(0))) && all(lessThan(other, imageSize(result)));
            if (is_inside && is_same_surface(pixel, other)) {
                vec4 value = texelFetch(found_now, other, 0);
                if (is_usable(value)) {
                    // From the pixel's own: squares of large equal values would cancel.
                    value -= origin;
                    sum += value;
                    squares += value * value;
                    count += 1.0;
                }
            }
        }
    }
    if (count < float(LEAST_NEIGHBOURS)) {
        return earlier;
    }
    vec4 mean = sum / count;
    vec4 around = sqrt(max(squares - sum * mean, 0.0) / (count - 1.0));
    vec4 width = clamp_width * max(around, deviation);
    vec4 kept = clamp(earlier, origin + mean - width, origin + mean + width);
    deviation = kept == earlier ? deviation : largest(around);
    return kept;
}
#endif

// Between a history, which may be anything where it does not count, and what is found now.
vec4 mixed(vec4 earlier, vec4 now, float share) {
    return share < 1.0 ? mix(earlier, now, share) : now;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    vec4 now = texelFetch(found_now, pixel, 0);
    vec4 mean = vec4(0.0);
    vec4 shown = is_usable(now) ? max(now, 0.0) : vec4(0.0);
    float pictures = 0.0;
    float deviation = 0.0;
    if (pixel_shows_geometry(pixel)) {
        float before = texelFetch(age, pixel, 0).x;
        deviation = texelFetch(age, pixel, 0).y;
        // Only where a surface's place is no number may these be none.
        deviation = is_usable(vec4(deviation)) ? deviation : 0.0;
        if (float(near_pixels) < cut_share * float(shown_pixels)) {
            before = 0.0;
        }
        if (mirror_age >= 0.0) {
            float roughness = texelFetch(gbuffer_shading_normal, pixel, 0).w;
            before = min(before, mirror_age * smoothstep(MIRROR, ROUGH, roughness));
        }
        vec4 earlier = texelFetch(reprojected, pixel, 0);
        if (!is_usable(earlier)) {
            before = 0.0;
        }
        if (!is_usable(now)) {
            mean = before > 0.0 ? earlier : vec4(0.0);
            shown = mean;
            pictures = before;
        } else {
#ifdef CLAMPS
            if (before > 0.0) {
                vec4 kept = held(pixel, earlier, deviation);
                // What had to be changed is no mean of anything: it counts as one picture.
                before = kept == earlier ? before : min(before, 1.0);
                earlier = kept;
            }
#endif
            pictures = before + 1.0;
            float step = before > 0.0 ? largest(abs(now - earlier)) : 0.0;
            deviation = before > 0.0 ? sqrt((deviation * deviation + step * step / pictures) * before / pictures) : 0.0;
            mean = max(mixed(earlier, now, 1.0 / pictures), 0.0);
            // The frame averages what its pictures show. Weights that grow make its average the mean of all pictures,
            // of this frame and before: so much of this one as to bring k times the mean of k - 1 pictures to k's.
            shown = max(mixed(earlier, now, min(pictures_of_frame / pictures, 1.0)), 0.0);
            pictures = min(pictures, most_age);
        }
    }
    imageStore(history_value, pixel, mean);
    imageStore(history_place, pixel, vec4(texelFetch(gbuffer_position, pixel, 0).xyz, pictures));
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    imageStore(history_normal, pixel, vec4(normal, min(deviation, LARGEST_HALF)));
    imageStore(result, pixel, shown);
}
