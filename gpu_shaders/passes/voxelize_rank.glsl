// SPDX-License-Identifier: GPL-3.0-or-later
// The number of a brick: how many there are before it along the Z-order curve.
#include "lib/z_order.glsl"

layout(std430, binding = BIT_BINDING) readonly buffer Bits { uint bits[]; };
layout(std430, binding = RANK_BINDING) readonly buffer Ranks { uint ranks[]; };

uniform uint brick_word; // first word of the bricks' level in `bits`

uint brick_number(uvec3 brick) {
    uint code = z_order(brick);
    uint word = brick_word + code / 32u;
    uint before = uint(bitCount(bits[word] & ((1u << (code % 32u)) - 1u)));
    return ranks[word] - ranks[brick_word] + before;
}
