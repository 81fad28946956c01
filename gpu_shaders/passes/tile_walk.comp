// SPDX-License-Identifier: GPL-3.0-or-later
// For each pair of a tile and a cluster: how many clusters and lights below the cluster the tile needs, which is all or
// none of them.
#include "lib/light_cluster.glsl"

layout(local_size_x = INVOCATIONS) in;

layout(std430, binding = TILE_BINDING) readonly buffer Tiles { PointGroup tiles[]; };
layout(std430, binding = LIGHT_NODE_BINDING) readonly buffer LightNodes { LightNode nodes[]; };
layout(std430, binding = LIST_BINDING) readonly buffer Pairs { uint pair_nodes[]; };
layout(std430, binding = PAIR_TILE_BINDING) readonly buffer PairTiles { uint pair_tiles[]; };
layout(std430, binding = NODE_COUNT_BINDING) writeonly buffer NodeCounts { uint node_counts[]; };
layout(std430, binding = LIGHT_COUNT_BINDING) writeonly buffer LightCounts { uint light_counts[]; };

uniform uint count;

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * INVOCATIONS + gl_LocalInvocationID.x;
    if (i >= count) {
        if (i == count) {
            node_counts[i] = 0u;
            light_counts[i] = 0u;
        }
        return;
    }
    PointGroup group = tiles[pair_tiles[i]];
    LightNode node = nodes[pair_nodes[i]];
    bool is_near = distance_range(group, node.centre).x < (1.0 + CLUSTER_FADE) * node.window;
    bool is_open = is_near && !cluster_gives_nothing(group, node);
    node_counts[i] = is_open ? node.end_child - node.first_child : 0u;
    light_counts[i] = is_open ? node.end_light - node.first_light : 0u;
}
