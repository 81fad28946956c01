// SPDX-License-Identifier: GPL-3.0-or-later
// What the walks of phase two do with the lights that they meet. They add up what these give, batch by batch: a plain
// sum over 100,000 lights would lose digits. Or (PICKS) they pick some of them for each pixel, in proportion to what
// they give there: those in which the running sum passes evenly spread shares of the sum, which an earlier walk found
// (systematic sampling). What is added up is seen as far as baked visibility says (BAKED).
#ifndef PASSES_LIGHT_SUM
#define PASSES_LIGHT_SUM
#include "passes/tile_pixels.glsl"

#if PICKS
#include "lib/spread_pattern.glsl"

layout(rgba32f, binding = 0) readonly uniform image2D irradiance; // W/m², of all lights
// W/m², mean of the channels: what the lights give that earlier dispatches met.
layout(r32f, binding = MET_IMAGE) uniform image2D met;
// 4 PICK_GROUPS for each pixel, row by row: a light, or a cluster with PICKED_CLUSTER, or NO_PICK.
layout(std430, binding = PICK_BINDING) buffer Picks { uvec4 picks[]; };

uniform uint pick_count;
uniform uint sample_index;

float met_sums[PIXELS];
vec4 thresholds[PIXELS * PICK_GROUPS]; // W/m²; negative ones are never met
uvec4 chosen[PIXELS * PICK_GROUPS];

int pick_group(ivec2 pixel, int group) {
    return (pixel.y * picture_size.x + pixel.x) * PICK_GROUPS + group;
}

void start_sums(uint tile) {
    for (int k = 0; k < PIXELS; ++k) {
        ivec2 pixel = min(pixel_at(tile, k), picture_size - 1);
        met_sums[k] = imageLoad(met, pixel).r;
        float total = dot(imageLoad(irradiance, pixel).rgb, vec3(1.0 / 3.0));
        // One number for all picks of a pixel: its thresholds are evenly spaced.
        float start = spread_pattern(uvec2(pixel), 0u, sample_index).x;
        for (int group = 0; group < PICK_GROUPS; ++group) {
            vec4 index = vec4(4 * group) + vec4(0.0, 1.0, 2.0, 3.0);
            vec4 wanted = (index + start) * (total / float(pick_count));
            int at = k * PICK_GROUPS + group;
            thresholds[at] = mix(vec4(-1.0), wanted, lessThan(index, vec4(float(pick_count))));
            chosen[at] = met_sums[k] > 0.0 ? picks[pick_group(pixel, group)] : uvec4(NO_PICK);
        }
    }
}

void start_batch() {
}

// id: what `picks` holds for it. value: W/m² at pixel k.
void meet(int k, uint id, vec3 value) {
    float gives = dot(value, vec3(1.0 / 3.0));
    float before = gives > 0.0 ? met_sums[k] : 3e38;
    for (int group = 0; group < PICK_GROUPS; ++group) {
        int at = k * PICK_GROUPS + group;
        // The last light that begins before a threshold holds it, whatever the rounding of the sum.
        uvec4 begins_before = uvec4(lessThanEqual(vec4(before), thresholds[at]));
        chosen[at] += (uvec4(id) - chosen[at]) * begins_before;
    }
    met_sums[k] += gives;
}

void end_batch() {
}

void store_sums(uint tile) {
    for (int k = 0; k < PIXELS; ++k) {
        ivec2 pixel = pixel_at(tile, k);
        if (shown[k]) {
            imageStore(met, pixel, vec4(met_sums[k]));
            for (int group = 0; group < PICK_GROUPS; ++group) {
                picks[pick_group(pixel, group)] = chosen[k * PICK_GROUPS + group];
            }
        }
    }
}
#else
#if BAKED
#include "passes/baked_rows.glsl"
#endif

layout(rgba32f, binding = 0) uniform image2D irradiance; // W/m²

vec3 sums[PIXELS];
vec3 batch_sums[PIXELS];

void start_sums(uint tile) {
    for (int k = 0; k < PIXELS; ++k) {
        sums[k] = vec3(0.0);
    }
#if BAKED
    fetch_baked_rows(tile);
#endif
}

void start_batch() {
    for (int k = 0; k < PIXELS; ++k) {
        batch_sums[k] = vec3(0.0);
    }
}

void meet(int k, uint id, vec3 value) {
#if BAKED
    if (any(greaterThan(value, vec3(0.0)))) {
        value *= baked_share(k, id & ~PICKED_CLUSTER);
    }
#endif
    batch_sums[k] += value;
}

void end_batch() {
    for (int k = 0; k < PIXELS; ++k) {
        sums[k] += batch_sums[k];
    }
}

void store_sums(uint tile) {
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            ivec2 pixel = pixel_at(tile, k);
            imageStore(irradiance, pixel, vec4(imageLoad(irradiance, pixel).rgb + sums[k], 1.0));
        }
    }
}
#endif
#endif
