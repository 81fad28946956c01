// SPDX-License-Identifier: GPL-3.0-or-later
// Takes the pattern of interleaved sampling out of a picture without blurring over edges (seed 004, 4.12; Laine et al.
// 2007). Pixels that are the same modulo INTERLEAVE in both directions are of one class: they used the same lights. A
// pixel gets the mean over the classes of what each has nearby on the same surface, moved back to the pixel along the
// slope where that is on one side of it. So every class weighs the same, and as they are always added in the same order,
// an even surface comes out even to the last bit.
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

// Whether the pixel at an offset counts for one, and its value.
bool counts(ivec2 pixel, Place place, ivec2 offset, out vec4 value) {
    ivec2 other = pixel + offset;
    value = vec4(0.0);
    if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, textureSize(values, 0)))) {
        return false;
    }
    value = texelFetch(values, other, 0);
    return is_usable(value) && (offset == ivec2(0) || is_one_surface(place, place_of(other)));
}

struct ClassMean {
    vec4 value;
    vec2 offset;    // sum of the members' offsets, pixels; whole numbers, so that it is 0 where they lie around the pixel
    float count;    // of members
    vec4 lowest;    // of 0 and all members' values
};

void add_member(ivec2 pixel, Place place, ivec2 offset, inout ClassMean mean) {
    vec4 value;
    if (counts(pixel, place, offset, value)) {
        // Not a sum over a count: what is the same for all is the mean, unrounded.
        mean.count += 1.0;
        mean.value += (value - mean.value) / mean.count;
        mean.offset += vec2(offset);
        mean.lowest = min(mean.lowest, value);
    }
}

// Mean over the members of a class within INTERLEAVE / 2 of a pixel, or, where none of those counts, within INTERLEAVE.
// step: from the pixel to a member, 0 to INTERLEAVE - 1. Loops that some pixels need and others not have no turns where
// they are not needed: software renderers run both sides of every branch.
ClassMean class_mean(ivec2 pixel, Place place, ivec2 step) {
    ClassMean mean = ClassMean(vec4(0.0), vec2(0.0), 0.0, vec4(0.0));
    ivec2 nearest = step - INTERLEAVE * ivec2(greaterThanEqual(2 * step, ivec2(INTERLEAVE)));
    ivec2 side = 1 + ivec2(equal(2 * step, ivec2(INTERLEAVE)));
    for (int k = 0; k < side.x * side.y; ++k) {
        add_member(pixel, place, nearest + INTERLEAVE * ivec2(k % side.x, k / side.x), mean);
    }
    for (int k = mean.count > 0.0 ? 9 : 0; k < 9; ++k) {
        ivec2 offset = step + INTERLEAVE * (ivec2(k % 3, k / 3) - 1);
        int farthest = max(abs(offset.x), abs(offset.y));
        if (farthest <= INTERLEAVE && 2 * farthest > INTERLEAVE) {
            add_member(pixel, place, offset, mean);
        }
    }
    return mean;
}

// How much the values grow for a pixel along an axis, a unit vector: the mean over pairs of one class, which used the
// same lights, so that the pattern is no part of it. Less of it where the pairs disagree, by how uncertain that makes
// their mean (James and Stein's estimator). 0 where there are no two pairs, or where it is not needed.
vec4 slope_along(ivec2 pixel, Place place, ivec2 axis, bool is_needed) {
    vec4 sum = vec4(0.0);
    float squares = 0.0, count = 0.0;
    for (int along = is_needed ? -INTERLEAVE : 1; along <= 0; ++along) {
        for (int across = -(INTERLEAVE / 2); across <= INTERLEAVE / 2; ++across) {
            ivec2 first = along * axis + across * (1 - axis);
            vec4 from, to;
            if (counts(pixel, place, first, from) && counts(pixel, place, first + INTERLEAVE * axis, to)) {
                vec4 growth = (to - from) / float(INTERLEAVE);
                sum += growth;
                squares += dot(growth.rgb, growth.rgb);
                count += 1.0;
            }
        }
    }
    if (count < 2.0) {
        return vec4(0.0);
    }
    vec4 mean = sum / count;
    float size = dot(mean.rgb, mean.rgb);
    float uncertainty = max(squares / count - size, 0.0) / (count - 1.0);
    return uncertainty < size ? mean * (1.0 - uncertainty / size) : vec4(0.0);
}

vec4 mean_of_classes(ivec2 pixel) {
    Place place = place_of(pixel);
    vec4 sum = vec4(0.0), lowest = vec4(0.0);
    vec2 offset = vec2(0.0);
    float total = 0.0;
    for (int k = 0; k < INTERLEAVE * INTERLEAVE; ++k) {
        ivec2 residue = ivec2(k % INTERLEAVE, k / INTERLEAVE);
        ivec2 step = (residue - pixel % INTERLEAVE + INTERLEAVE) % INTERLEAVE;
        ClassMean mean = class_mean(pixel, place, step);
        if (mean.count > 0.0) {
            sum += mean.value;
            offset += mean.offset / mean.count;
            total += 1.0;
            lowest = min(lowest, mean.lowest);
        }
    }
    // Where more counted on one side, the mean is that of a place beside the pixel.
    vec4 aside = offset.x * slope_along(pixel, place, ivec2(1, 0), offset.x != 0.0)
        + offset.y * slope_along(pixel, place, ivec2(0, 1), offset.y != 0.0);
    return total > 0.0 ? max((sum - aside) / total, lowest) : vec4(0.0);
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
