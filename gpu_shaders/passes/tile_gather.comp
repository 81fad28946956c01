// SPDX-License-Identifier: GPL-3.0-or-later
// Where the lists of tiles begin after pairs have become what is below them.

layout(local_size_x = INVOCATIONS) in;

layout(std430, binding = LIST_OFFSET_BINDING) readonly buffer ListOffsets { uint list_offsets[]; };
layout(std430, binding = OFFSET_BINDING) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = GATHERED_BINDING) writeonly buffer Gathered { uint gathered[]; };

uniform uint count;

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * INVOCATIONS + gl_LocalInvocationID.x;
    if (i < count) {
        gathered[i] = offsets[list_offsets[i]];
    }
}
