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

// Whether all rows of the tile see the light that is met next whole: then nobody need look.
bool is_whole = false;

// The share of a light or cluster that pixel k sees: the mean of its rows that say something of it. Exactly 1 where all
// of these see it whole: sums of whole numbers below 2^24. 1 for a pixel without rows.
float baked_share(int k, uint light) {
    if (is_whole) {
        return 1.0;
    }
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

#define TILE_SEES_SOME 0
#define TILE_SEES_WHOLE 1
#define TILE_SEES_NOTHING 2
#define MOST_TILE_ROWS 64u
#define TILE_SLOTS 128u

// A set of the rows of the tile's pixels, each with 1 added, by open addressing; and the same as a list.
shared uint tile_slots[TILE_SLOTS];
shared uint tile_rows[MOST_TILE_ROWS];
// More than MOST_TILE_ROWS where they are too many, or a pixel has none.
shared uint tile_row_count;

void add_tile_row(uint row) {
    uint slot = row * 2654435769u >> 25;
    for (uint i = 0u; i < TILE_SLOTS; ++i) {
        uint found = atomicCompSwap(tile_slots[slot], 0u, row + 1u);
        if (found == row + 1u) {
            return;
        }
        if (found == 0u) {
            uint at = atomicAdd(tile_row_count, 1u);
            if (at < MOST_TILE_ROWS) {
                tile_rows[at] = row;
            }
            return;
        }
        slot = (slot + 1u) % TILE_SLOTS;
    }
}

// After fetch_baked_rows, by all invocations.
void gather_tile_rows() {
    for (uint i = gl_LocalInvocationIndex; i < TILE_SLOTS; i += GROUP_SIZE) {
        tile_slots[i] = 0u;
    }
    if (gl_LocalInvocationIndex == 0u) {
        tile_row_count = 0u;
    }
    barrier();
    for (int k = 0; k < PIXELS; ++k) {
        if (!shown[k]) {
            continue;
        }
        if (baked_rows[BAKED_GROUPS * k].x == 0u) {
            atomicAdd(tile_row_count, MOST_TILE_ROWS + 1u);
        }
        for (int i = 0; i < 4 * BAKED_GROUPS; ++i) {
            uint word = baked_rows[BAKED_GROUPS * k + i / 4][i % 4];
            if (word != 0u) {
                add_tile_row(word >> BAKED_WEIGHT_BITS);
            }
        }
    }
    barrier();
}

// What the pixels of the tile see of a light or cluster.
int tile_sees(uint light) {
    bool whole = true, nothing = true;
    for (uint i = 0u; i < min(tile_row_count, MOST_TILE_ROWS); ++i) {
        uint share = baked_shares[tile_rows[i] * words_per_row + light / 4u] >> 8u * (light & 3u) & 255u;
        whole = whole && share == BAKED_FULL;
        nothing = nothing && (share == 0u || share == BAKED_UNFACED);
    }
    bool is_known = tile_row_count > 0u && tile_row_count <= MOST_TILE_ROWS;
    return is_known && whole ? TILE_SEES_WHOLE : (is_known && nothing ? TILE_SEES_NOTHING : TILE_SEES_SOME);
}
#endif
