// SPDX-License-Identifier: GPL-3.0-or-later
// Gathers the marked pixels in a G-buffer of their own, group after group, so that neighbours stay together: each run of
// GROUP_SIDE² of them fills a square of that side.
#include "passes/low_resolution_copy.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

#define GROUP_SIZE (GROUP_SIDE * GROUP_SIDE)

layout(r8ui, binding = 7) readonly uniform uimage2D is_redone;
layout(std430, binding = COUNT_BINDING) readonly buffer Counts { uint counts[]; }; // of all groups before each

shared uint marks[GROUP_SIZE / 32];

void main() {
    uint index = gl_LocalInvocationIndex;
    if (index < uint(GROUP_SIZE / 32)) {
        marks[index] = 0u;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    bool marked = all(lessThan(pixel, imageSize(is_redone))) && imageLoad(is_redone, pixel).x != 0u;
    if (marked) {
        atomicOr(marks[index / 32u], 1u << (index % 32u));
    }
    barrier();
    if (!marked) {
        return;
    }
    uint place = counts[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x];
    for (uint word = 0u; word < index / 32u; ++word) {
        place += uint(bitCount(marks[word]));
    }
    place += uint(bitCount(marks[index / 32u] & ((1u << (index % 32u)) - 1u)));
    uint square = place / uint(GROUP_SIZE), within = place % uint(GROUP_SIZE);
    uint columns = uint(imageSize(picked_pixel).x / GROUP_SIDE);
    ivec2 corner = GROUP_SIDE * ivec2(square % columns, square / columns);
    pick(pixel, corner + ivec2(within % uint(GROUP_SIDE), within / uint(GROUP_SIDE)));
}
