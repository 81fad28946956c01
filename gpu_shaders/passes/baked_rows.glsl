// SPDX-License-Identifier: GPL-3.0-or-later
// What the pixels of an invocation see of lights, from baked visibility; passes/baked_pixels.comp found their rows.
#ifndef PASSES_BAKED_ROWS
#define PASSES_BAKED_ROWS
#include "passes/tile_pixels.glsl"
#include "lib/baked_visibility.glsl"

// Of lights, or of clusters: a byte for each, four in a word, rows one after the other.
layout(std430, binding = BAKED_SHARE_BINDING) readonly buffer BakedShares { uint baked_shares[]; };
layout(binding = BAKED_ROW_UNIT_0) uniform usampler2D first_baked_rows;
layout(binding = BAKED_ROW_UNIT_1) uniform usampler2D second_baked_rows;
layout(binding = BAKED_ROW_UNIT_2) uniform usampler2D third_baked_rows;

uniform uint words_per_row;

#define BAKED_GROUPS 3

// Four rows and weights each, largest weights first.
uvec4 baked_rows[PIXELS * BAKED_GROUPS];

void fetch_baked_rows(uint tile) {
    for (int k = 0; k < PIXELS; ++k) {
        ivec2 pixel = min(pixel_at(tile, k), picture_size - 1);
        baked_rows[BAKED_GROUPS * k] = texelFetch(first_baked_rows, pixel, 0);
        baked_rows[BAKED_GROUPS * k + 1] = texelFetch(second_baked_rows, pixel, 0);
        baked_rows[BAKED_GROUPS * k + 2] = texelFetch(third_baked_rows, pixel, 0);
    }
}

// The share of a light or cluster that pixel k sees: the mean of its rows that say something of it. Exactly 1 where all
// of these see it whole: sums of whole numbers below 2^24. 1 for a pixel without rows.
float baked_share(int k, uint light) {
    float total = 0.0, sum = 0.0;
    for (int group = 0; group < BAKED_GROUPS; ++group) {
        uvec4 words = baked_rows[BAKED_GROUPS * k + group];
        if (words.x == 0u) {
            break;
        }
        uvec4 at = rows_of_packed(words) * words_per_row + light / 4u;
        uvec4 found = uvec4(baked_shares[at.x], baked_shares[at.y], baked_shares[at.z], baked_shares[at.w]);
        vec4 shares = bytes_of_words(found, light);
        vec4 weights = mix(weights_of_packed(words), vec4(0.0), equal(shares, vec4(BAKED_UNFACED)));
        total += dot(weights, vec4(1.0));
        sum += dot(weights, shares);
    }
    bool has_rows = baked_rows[BAKED_GROUPS * k].x != 0u;
    return total > 0.0 ? sum / (float(BAKED_FULL) * total) : (has_rows ? 0.0 : 1.0);
}
#endif
