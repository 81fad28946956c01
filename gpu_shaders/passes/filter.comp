// SPDX-License-Identifier: GPL-3.0-or-later
// Takes the pattern of interleaved sampling out of a picture without blurring over edges (seed 004, 4.12; Laine et al.
// 2007). Pixels that are the same modulo INTERLEAVE in both directions are of one class: they used the same lights. A
// pixel gets the mean over the classes of what each has nearby on the same surface: so every class weighs the same, and
// as they are always added in the same order, an even surface comes out even to the last bit.
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = VALUE_UNIT) uniform sampler2D values;
layout(rgba32f, binding = 0) writeonly uniform image2D result;
layout(std430, binding = COUNT_BINDING) buffer Count { uint unusable_count; };

uniform float least_cosine;                 // of the angle between shading normals of what is one surface
uniform float position_threshold;           // share of the picture's width, from either pixel's plane
uniform float width_at_0, width_per_depth;  // of the picture, m: width_at_0 + width_per_depth x depth

struct Place {
    vec3 position;
    vec3 shading_normal;
    vec3 geometric_normal;
    float reach;    // m, from its plane
};

Place place_of(ivec2 pixel) {
    vec4 position = texelFetch(gbuffer_position, pixel, 0);
    return Place(
        position.xyz, texelFetch(gbuffer_shading_normal, pixel, 0).xyz,
        texelFetch(gbuffer_geometric_normal, pixel, 0).xyz,
        position_threshold * (width_at_0 + width_per_depth * position.w)
    );
}

bool is_usable(vec4 value) {
    // As whole numbers: drivers may take any comparison with NaN for true.
    return all(lessThan(floatBitsToUint(value) & 0x7fffffffu, uvec4(floatBitsToUint(LARGEST))));
}

// The same both ways round.
bool is_one_surface(Place a, Place b) {
    vec3 way = b.position - a.position;
    return shows_geometry(b.geometric_normal) && dot(a.shading_normal, b.shading_normal) >= least_cosine
        && abs(dot(way, a.geometric_normal)) <= a.reach && abs(dot(way, b.geometric_normal)) <= b.reach;
}

// Mean over the members of a class in the square of 2 INTERLEAVE + 1 pixels around one: those within half of that, or,
// (is_far) the others. step: from the pixel to a member, 0 to INTERLEAVE - 1. found: whether there is one that counts.
vec4 class_mean(ivec2 pixel, Place place, ivec2 step, bool is_far, out bool found) {
    ivec2 size = textureSize(values, 0);
    vec4 mean = vec4(0.0);
    float count = 0.0;
    for (int k = 0; k < 9; ++k) {
        ivec2 offset = step + INTERLEAVE * (ivec2(k % 3, k / 3) - 1);
        ivec2 other = pixel + offset;
        int farthest = max(abs(offset.x), abs(offset.y));
        bool is_inside = all(greaterThanEqual(other, ivec2(0))) && all(lessThan(other, size));
        if (!is_inside || farthest > INTERLEAVE || (2 * farthest > INTERLEAVE) != is_far) {
            continue;
        }
        vec4 value = texelFetch(values, other, 0);
        if (is_usable(value) && (farthest == 0 || is_one_surface(place, place_of(other)))) {
            // Not a sum over a count: what is the same for all is the mean, unrounded.
            count += 1.0;
            mean += (value - mean) / count;
        }
    }
    found = count > 0.0;
    return mean;
}

vec4 mean_of_classes(ivec2 pixel) {
    Place place = place_of(pixel);
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int k = 0; k < INTERLEAVE * INTERLEAVE; ++k) {
        ivec2 residue = ivec2(k % INTERLEAVE, k / INTERLEAVE);
        ivec2 step = (residue - pixel % INTERLEAVE + INTERLEAVE) % INTERLEAVE;
        bool found;
        vec4 mean = class_mean(pixel, place, step, false, found);
        if (!found) {
            mean = class_mean(pixel, place, step, true, found);
        }
        if (found) {
            sum += mean;
            total += 1.0;
        }
    }
    return total > 0.0 ? sum / total : vec4(0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    vec4 filtered = vec4(0.0);
    if (pixel_shows_geometry(pixel)) {
        if (!is_usable(texelFetch(values, pixel, 0))) {
            atomicAdd(unusable_count, 1u);
        }
        filtered = mean_of_classes(pixel);
    }
    imageStore(result, pixel, filtered);
}
