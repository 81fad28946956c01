// SPDX-License-Identifier: GPL-3.0-or-later
// What views have told of the points of a kernel: two bits each.
#ifndef PASSES_AMBIENT_OCCLUSION_POINTS
#define PASSES_AMBIENT_OCCLUSION_POINTS

#define POINT_UNKNOWN 0
#define POINT_FREE 1
#define POINT_CLOSED 2

// Adds to what is told of up to POINTS_IN_RUN points: xy: a bit for each that some view says is free; zw: is closed.
void tell(inout uvec4 told, int point, int found) {
    told[point >> 5] |= uint(found == POINT_FREE) << (point & 31);
    told[2 + (point >> 5)] |= uint(found == POINT_CLOSED) << (point & 31);
}

// Whether a point is in the way: a view says so, and none sees it before what it shows.
bool is_in_the_way(uvec4 told, int point) {
    return ((told[2 + (point >> 5)] & ~told[point >> 5]) >> (point & 31) & 1u) != 0u;
}
#endif
