// SPDX-License-Identifier: GPL-3.0-or-later
// Writes zeros into a buffer.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BIT_BINDING) writeonly buffer Words { uint words[]; };

uniform uint first;
uniform uint count;

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index < count) {
        words[first + index] = 0u;
    }
}
