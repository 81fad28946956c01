// SPDX-License-Identifier: GPL-3.0-or-later
// What a work group walks over: a run of all lights, or (LISTED) of its tile's list of lights or clusters.
#ifndef PASSES_TILE_LISTS
#define PASSES_TILE_LISTS

// A run within the list: lists are walked in several dispatches where they are long.
uniform uint first_entry;
uniform uint end_entry;

#if LISTED
// The tile of each work group, and where its list begins in `entries`.
layout(std430, binding = LIST_OFFSET_BINDING) readonly buffer ListOffsets { uint list_offsets[]; };
layout(std430, binding = LIST_BINDING) readonly buffer Entries { uint entries[]; };
layout(std430, binding = LIST_TILE_BINDING) readonly buffer ListTiles { uint list_tiles[]; };

uint this_tile() {
    return list_tiles[gl_WorkGroupID.x];
}

// First and end of the run, in `entries`.
uvec2 this_run() {
    uint start = list_offsets[gl_WorkGroupID.x], end = list_offsets[gl_WorkGroupID.x + 1u];
    return min(uvec2(start) + uvec2(first_entry, end_entry), uvec2(end));
}

uint entry(uint at) {
    return entries[at];
}
#else
uint this_tile() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

uvec2 this_run() {
    return uvec2(first_entry, end_entry);
}

uint entry(uint at) {
    return at;
}
#endif
#endif
