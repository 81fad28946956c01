// SPDX-License-Identifier: GPL-3.0-or-later
// Lists the marked pixels, group after group, so that neighbours stay together.

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

#define GROUP_SIZE (GROUP_SIDE * GROUP_SIDE)

layout(binding = MARK_UNIT) uniform usampler2D marks;
layout(std430, binding = COUNT_BINDING) readonly buffer Counts { uint counts[]; }; // of all groups before each
layout(std430, binding = LIST_BINDING) writeonly buffer List { ivec2 listed[]; };

shared uint bits[GROUP_SIZE / 32];

void main() {
    uint index = gl_LocalInvocationIndex;
    if (index < uint(GROUP_SIZE / 32)) {
        bits[index] = 0u;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    bool marked = all(lessThan(pixel, textureSize(marks, 0))) && texelFetch(marks, pixel, 0).x == MARK_REDONE;
    if (marked) {
        atomicOr(bits[index / 32u], 1u << (index % 32u));
    }
    barrier();
    if (!marked) {
        return;
    }
    uint place = counts[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x];
    for (uint word = 0u; word < index / 32u; ++word) {
        place += uint(bitCount(bits[word]));
    }
    place += uint(bitCount(bits[index / 32u] & ((1u << (index % 32u)) - 1u)));
    listed[place] = pixel;
}
