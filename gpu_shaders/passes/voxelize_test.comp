// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells of each block its triangle meets, and how many those are in all; MARK: also into the bits of the bricks.
#include "passes/voxelize_meetings.glsl"
#include "lib/z_order.glsl"

#if MARK
layout(std430, binding = BIT_BINDING) buffer Bits { uint bits[]; };
uniform uint brick_word; // first word of the bricks' level
#endif

uniform float side; // of a cell, in voxels
uniform float growth;

void main() {
    if (gl_LocalInvocationID.x == 0u) {
        group_total = 0u;
    }
    barrier();
    uint index = block_index();
    if (index < block_count) {
        uvec2 block = blocks[index];
        uvec3 first = unpacked_cell(block.x);
        uint mask = cells_that_meet(triangle_at(block.y), first, side, growth);
        meetings[index] = mask;
        if (mask != 0u) {
            atomicAdd(group_total, uint(bitCount(mask)));
        }
#if MARK
        for (uint left = mask; left != 0u; left &= left - 1u) {
            uint i = uint(findLSB(left));
            uint code = z_order(first + uvec3(i & 1u, i >> 1 & 1u, i >> 2));
            atomicOr(bits[brick_word + code / 32u], 1u << (code % 32u));
        }
#endif
    }
    barrier();
    if (gl_LocalInvocationID.x == 0u && group_total != 0u) {
        atomicAdd(total, group_total);
    }
}
