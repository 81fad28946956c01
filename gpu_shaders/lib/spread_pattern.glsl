// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers that are evenly spread over pixels near each other: any 4 x 4 of them together have a Hammersley set, as a
// filter over 4 x 4 pixels wants them. float32 form of vlm_addon/core/spread_pattern.py.
#ifndef LIB_SPREAD_PATTERN
#define LIB_SPREAD_PATTERN
#include "lib/hash.glsl"

// Which of 16 a pixel is: those of any 4 x 4 differ, and those of any 2 x 2 are spread (Bayer 1973).
uint bayer_rank(uvec2 pixel) {
    uint differ = pixel.x ^ pixel.y;
    return (differ & 1u) << 3 | (pixel.y & 1u) << 2 | (differ >> 1 & 1u) << 1 | (pixel.y >> 1 & 1u);
}

// Two numbers in [0, 1) for a pixel's pick `index`. x: the same for every index, each 16th once in 4 x 4 pixels; y: the
// radical inverse. Both move on from sample to sample, by the golden ratio and by the root of 2, so that the samples of a
// pixel are spread as well.
vec2 spread_pattern(uvec2 pixel, uint index, uint sample_index) {
    uint rank = bayer_rank(pixel);
    uint across = (rank << 28) + sample_index * 2654435769u;
    uint along = bitfieldReverse(16u * index + rank) + sample_index * 1779033703u;
    return vec2(unit_float(across), unit_float(along));
}
#endif
