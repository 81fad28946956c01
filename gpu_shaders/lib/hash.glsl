// SPDX-License-Identifier: GPL-3.0-or-later
// Integer hashes to uniform numbers.
#ifndef LIB_HASH
#define LIB_HASH

// Permuted congruential generator, output permutation only (Jarzynski and Olano 2020, "pcg").
uint pcg_hash(uint value) {
    uint state = value * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Uniform in [0, 1).
float unit_float(uint bits) {
    return float(bits >> 8u) * (1.0 / 16777216.0);
}

// One number in [0, 1) for each pixel, surface and sample; its sequence over samples is evenly spread (golden ratio).
float spread_random(uvec2 pixel, uint surface, uint sample_index) {
    uint start = pcg_hash(pixel.x + pcg_hash(pixel.y + pcg_hash(surface)));
    return unit_float(start + sample_index * 2654435769u);
}
#endif
