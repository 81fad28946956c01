// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of every pixel from the clusters in the list of its tile, each with its weight there, added to what
// earlier lists gave. Or (PICKS) some of these clusters.
#define TILE_ACCESS readonly
#include "passes/tile_pixels.glsl"
#include "passes/tile_lists.glsl"
#include "passes/light_sum.glsl"
#include "lib/light_cluster.glsl"

#define WORDS (GROUP_SIZE / 32)

layout(std430, binding = LIGHT_NODE_BINDING) readonly buffer LightNodes { LightNode nodes[]; };
layout(std430, binding = LIGHT_CLUSTER_BINDING) readonly buffer LightClusters { LightCluster clusters[]; };

// One bit for each cluster of a batch that may light the tile.
shared uint members[WORDS];
#if BAKED
// And for each that all of the tile sees whole.
shared uint wholes[WORDS];
#endif

void classify(PointGroup group, uint first, uint end) {
    uint index = gl_LocalInvocationIndex;
    if (index < uint(WORDS)) {
        members[index] = 0u;
#if BAKED
        wholes[index] = 0u;
#endif
    }
    barrier();
    uint at = first + index;
    if (at < end) {
        LightNode node = nodes[entries[at]];
        bool is_lit = any(greaterThan(clusters[entries[at]].power, vec3(0.0)));
        bool counts = distance_range(group, node.centre).y > node.window;
        bool gives = is_lit && counts && !cluster_gives_nothing(group, node);
#if BAKED
        int seen = gives ? tile_sees(entries[at]) : TILE_SEES_NOTHING;
        gives = seen != TILE_SEES_NOTHING;
        if (seen == TILE_SEES_WHOLE) {
            atomicOr(wholes[index / 32u], 1u << (index % 32u));
        }
#endif
        if (gives) {
            atomicOr(members[index / 32u], 1u << (index % 32u));
        }
    }
    barrier();
}

void main() {
    uint tile = this_tile();
    uvec2 run = this_run();
    if (run.x >= run.y) {
        return;
    }
    PointGroup group = tiles[tile];
    fetch_pixels(tile);
    start_sums(tile);
#if BAKED
    gather_tile_rows();
#endif
    for (uint first = run.x; first < run.y; first += GROUP_SIZE) {
        classify(group, first, run.y);
        start_batch();
        for (int word = 0; word < WORDS; ++word) {
            uint bits = members[word];
            while (bits != 0u) {
                int bit = findLSB(bits);
                uint i = entries[first + uint(32 * word + bit)];
                bits &= bits - 1u;
#if BAKED
                is_whole = (wholes[word] >> bit & 1u) != 0u;
#endif
                LightNode node = nodes[i];
                LightCluster cluster = clusters[i];
                for (int k = 0; k < PIXELS; ++k) {
                    float factor = cluster_weight(node, cluster, positions[k])
                        * cluster_factor(node, cluster, positions[k], normals[k]);
                    meet(k, PICKED_CLUSTER | i, IS_LEFT_OUT(cluster.tag_id, k) ? vec3(0.0) : factor * cluster.power);
                }
            }
        }
        end_batch();
        barrier();
    }
    store_sums(tile);
}
