// SPDX-License-Identifier: GPL-3.0-or-later
// Sums of runs of RUN values, or (SPREAD) from the sums before each run the sum before each value, in its place.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = VALUE_BINDING) buffer Values { uint values[]; };
layout(std430, binding = RUN_SUM_BINDING) buffer RunSums { uint run_sums[]; };

uniform uint count;

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint run = group * GROUP_SIZE + gl_LocalInvocationID.x;
    uint start = run * RUN;
    if (start >= count) {
        return;
    }
    uint stop = min(start + RUN, count);
#if SPREAD
    uint sum = run_sums[run];
    for (uint i = start; i < stop; ++i) {
        uint value = values[i];
        values[i] = sum;
        sum += value;
    }
#else
    uint sum = 0u;
    for (uint i = start; i < stop; ++i) {
        sum += values[i];
    }
    run_sums[run] = sum;
#endif
}
