// SPDX-License-Identifier: GPL-3.0-or-later
// Counts in each group the pixels that are to be gathered at full resolution, and in all those that show a surface.

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = MARK_UNIT) uniform usampler2D marks;
layout(std430, binding = COUNT_BINDING) writeonly buffer Counts { uint counts[]; };
layout(std430, binding = SHOWN_BINDING) buffer Shown { uint shown; };

shared uint group_shown, group_redone;

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        group_shown = group_redone = 0u;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, textureSize(marks, 0)))) {
        uint mark = texelFetch(marks, pixel, 0).x;
        if (mark != MARK_EMPTY) {
            atomicAdd(group_shown, 1u);
        }
        if (mark == MARK_REDONE) {
            atomicAdd(group_redone, 1u);
        }
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        counts[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] = group_redone;
        atomicAdd(shown, group_shown);
    }
}
