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
        for (int i = 0; i < 4; ++i) {
            uint word = baked_shares[row_of_packed(words[i]) * words_per_row + light / 4u];
            float weight = weight_of_packed(words[i]), share = byte_of_word(word, light);
            weight = share == float(BAKED_UNFACED) ? 0.0 : weight;
            total += weight;
            sum += weight * share;
        }
    }
    bool has_rows = baked_rows[BAKED_GROUPS * k].x != 0u;
    return total > 0.0 ? sum / (float(BAKED_FULL) * total) : (has_rows ? 0.0 : 1.0);
}
#endif
