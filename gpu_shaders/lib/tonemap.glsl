// SPDX-License-Identifier: GPL-3.0-or-later
// Luminances to display, after their contrast has been brought into range.
#ifndef LIB_TONEMAP
#define LIB_TONEMAP

// Luminance of linear Rec.709; what is negative counts as 0.
float rec709_luminance(vec3 color) {
    return dot(max(color, 0.0), vec3(0.2126, 0.7152, 0.0722));
}

// Display luminance in [0, 1] of a luminance whose middle is a key of about 0.18: rises all the way, and reaches 1 at
// `white`, above which it stays (Reinhard et al. 2002, eq. 4).
float photographic_curve(float luminance, float white) {
    return min(luminance * (1.0 + luminance / (white * white)) / (1.0 + luminance), 1.0);
}

// The colour of the same luminance in [0, 1], mixed with as little grey as brings it within 1.
vec3 within_display(vec3 color, float luminance) {
    float largest = max(max(color.r, color.g), color.b);
    float share = largest > 1.0 ? (1.0 - luminance) / (largest - luminance) : 1.0;
    return clamp(mix(vec3(luminance), color, share), 0.0, 1.0);
}
#endif
