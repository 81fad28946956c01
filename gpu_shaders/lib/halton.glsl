// SPDX-License-Identifier: GPL-3.0-or-later
// Halton's points; float32 form of vlm_addon/core/halton.py.
#ifndef LIB_HALTON
#define LIB_HALTON

// The greatest float32 below 1.
#define BELOW_1 0.99999994

// A whole number with its digits in `base` mirrored at the point, in [0, 1). For numbers whose digits, mirrored, are
// below 2^32: all below 2^31 in base 2, 3^20 in base 3, 5^13, 7^11, 11^9, 13^8.
float radical_inverse(uint number, uint base) {
    uint mirrored = 0u, scale = 1u;
    for (uint rest = number; rest > 0u; rest /= base) {
        mirrored = mirrored * base + rest % base;
        scale *= base;
    }
    return min(float(mirrored) / float(scale), BELOW_1);
}

// A coordinate moved around [0, 1) by `shift` in [0, 1) (Cranley and Patterson 1976).
float rotated(float coordinate, float shift) {
    return min(fract(coordinate + shift), BELOW_1);
}
#endif
