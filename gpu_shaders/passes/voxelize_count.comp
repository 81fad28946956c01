// SPDX-License-Identifier: GPL-3.0-or-later
// How many bits each word has.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BIT_BINDING) readonly buffer Bits { uint bits[]; };
layout(std430, binding = RANK_BINDING) writeonly buffer Ranks { uint ranks[]; };

uniform uint words;

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index <= words) {
        ranks[index] = index < words ? uint(bitCount(bits[index])) : 0u;
    }
}
