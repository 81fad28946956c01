// SPDX-License-Identifier: GPL-3.0-or-later
// The clusters, or (LIGHTS) the lights, below pairs of a tile and a cluster, one after the other in the pairs' order.
// Every invocation writes one and looks up the pair that it belongs to, so nothing depends on their order.
#include "gpu_layout/LightNode"

layout(local_size_x = INVOCATIONS) in;

layout(std430, binding = LIGHT_NODE_BINDING) readonly buffer LightNodes { LightNode nodes[]; };
layout(std430, binding = LIST_BINDING) readonly buffer Pairs { uint pair_nodes[]; };
layout(std430, binding = PAIR_TILE_BINDING) readonly buffer PairTiles { uint pair_tiles[]; };
// Where what is below each pair begins.
layout(std430, binding = OFFSET_BINDING) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = CHILD_BINDING) writeonly buffer Children { uint children[]; };
#if LIGHTS
layout(std430, binding = LIGHT_ID_BINDING) readonly buffer LightIds { uint light_ids[]; };
#else
layout(std430, binding = CHILD_TILE_BINDING) writeonly buffer ChildTiles { uint child_tiles[]; };
#endif

// A run of what is below all pairs.
uniform uint first;
uniform uint end;
uniform uint pair_count;

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * INVOCATIONS + gl_LocalInvocationID.x;
    uint at = first + i;
    if (at >= end) {
        return;
    }
    // The last pair that begins at `at` or before.
    uint pair = 0u, above = pair_count;
    while (above - pair > 1u) {
        uint middle = (pair + above) / 2u;
        bool begins = offsets[middle] <= at;
        pair = begins ? middle : pair;
        above = begins ? above : middle;
    }
    uint within = at - offsets[pair];
    LightNode node = nodes[pair_nodes[pair]];
#if LIGHTS
    children[i] = light_ids[node.first_light + within];
#else
    children[i] = node.first_child + within;
    child_tiles[i] = pair_tiles[pair];
#endif
}
