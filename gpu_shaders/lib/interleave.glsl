// SPDX-License-Identifier: GPL-3.0-or-later
// Where the pixels of a picture lie in its split form: n x n tiles side by side, each with every n-th pixel of both
// directions (Segovia et al. 2006; seed 004, eq. 4.1 to 4.6).
#ifndef LIB_INTERLEAVE
#define LIB_INTERLEAVE

// The picture's pixel that a texel of the split picture holds; may lie beyond the picture, whose tiles are padded.
ivec2 interleaved_pixel(ivec2 texel, int n, ivec2 tile_size) {
    return texel % tile_size * n + texel / tile_size;
}

// The inverse: the texel of the split picture that holds a pixel.
ivec2 interleaved_texel(ivec2 pixel, int n, ivec2 tile_size) {
    return pixel % n * tile_size + pixel / n;
}
#endif
