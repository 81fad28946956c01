// SPDX-License-Identifier: GPL-3.0-or-later
// What views have told of the points of a kernel: two bits each, up to POINTS_IN_RUN points.
#ifndef PASSES_AMBIENT_OCCLUSION_POINTS
#define PASSES_AMBIENT_OCCLUSION_POINTS

// Each overrules those before it.
#define POINT_UNKNOWN 0u    // not in the view, or far behind what it shows
#define POINT_ASSUMED 1u    // in the way if what the view shows is thick
#define POINT_FREE 2u       // before what the view shows
#define POINT_CLOSED 3u     // the way to it goes through what the view shows

#define POINTS_IN_WORD 16

// Adds what a view has found of a point.
void tell(inout uvec4 told, int point, uint found) {
    int word = point / POINTS_IN_WORD, first_bit = 2 * (point % POINTS_IN_WORD);
    uint known = bitfieldExtract(told[word], first_bit, 2);
    told[word] = bitfieldInsert(told[word], max(known, found), first_bit, 2);
}

bool is_in_the_way(uint found) {
    return found == POINT_ASSUMED || found == POINT_CLOSED;
}

// What all views together have found of a point.
uint told_of(uvec4 told, int point) {
    return bitfieldExtract(told[point / POINTS_IN_WORD], 2 * (point % POINTS_IN_WORD), 2);
}
#endif
