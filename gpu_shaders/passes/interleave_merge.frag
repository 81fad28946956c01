// SPDX-License-Identifier: GPL-3.0-or-later
// Puts what was found for the tiles of a split picture where their pixels are (seed 004, 4.11).
#include "lib/interleave.glsl"

layout(binding = SPLIT_UNIT) uniform sampler2D split_picture;
layout(location = 0) out vec4 out_merged;

uniform ivec2 tile_size;

void main() {
    out_merged = texelFetch(split_picture, interleaved_texel(ivec2(gl_FragCoord.xy), INTERLEAVE, tile_size), 0);
}
