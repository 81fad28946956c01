// SPDX-License-Identifier: GPL-3.0-or-later
// One level of the octree as bits, one for each cell along the Z-order curve, from the level below: a byte of that is
// the octants of a cell.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BIT_BINDING) buffer Bits { uint bits[]; };

uniform uint level_word; // first word of the level
uniform uint child_word; // of the level below
uniform uint cells; // of the level

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint first = 32u * (group * GROUP_SIZE + gl_LocalInvocationID.x);
    if (first >= cells) {
        return;
    }
    uint found = 0u;
    uint count = min(cells - first, 32u);
    for (uint i = 0u; i < count; ++i) {
        uint octants = bits[child_word + (first + i) / 4u] >> (8u * (i % 4u)) & 255u;
        found |= uint(octants != 0u) << i;
    }
    bits[level_word + first / 32u] = found;
}
