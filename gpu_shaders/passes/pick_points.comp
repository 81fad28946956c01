// SPDX-License-Identifier: GPL-3.0-or-later
// Turns each picked light or cluster into a source sample of a light: down the tree of lights, then among the light's
// samples, each time in proportion to what is met there, so that visibility is asked for where the light comes from.
// One invocation for a pixel and a pick.
#include "gpu_layout/VirtualLight"
#include "gpu_layout/LightPoint"
#include "passes/gbuffer_samplers.glsl"
#include "lib/light_cluster.glsl"
#include "lib/spread_pattern.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused
layout(std430, binding = LIGHT_POINT_BINDING) readonly buffer LightPoints { LightPoint points[]; };
layout(std430, binding = POINT_OFFSET_BINDING) readonly buffer PointOffsets { uint point_offsets[]; };
layout(std430, binding = PICK_BINDING) buffer Picks { uint picks[]; };
#if CLUSTERED
layout(std430, binding = LIGHT_NODE_BINDING) readonly buffer LightNodes { LightNode nodes[]; };
layout(std430, binding = LIGHT_CLUSTER_BINDING) readonly buffer LightClusters { LightCluster clusters[]; };
layout(std430, binding = LIGHT_ID_BINDING) readonly buffer LightIds { uint light_ids[]; };
#endif

layout(r32f, binding = MET_IMAGE) readonly uniform image2D met;

uniform uint sample_index;

// One of the things that `meet_share` is told of, each with a probability in proportion to its share; `number` is
// random, and is so still for what comes after.
struct Choice {
    uint id;
    float sum;
    float number;
};

void meet_share(inout Choice choice, uint id, float share) {
    if (!(share > 0.0)) {
        return;
    }
    choice.sum += share;
    float probability = share / choice.sum;
    bool taken = choice.number < probability;
    choice.id = taken ? id : choice.id;
    float rest = max(1.0 - probability, 1e-7);
    choice.number = min(taken ? choice.number / probability : (choice.number - probability) / rest, 1.0);
}

#if CLUSTERED
// What a light or a cluster that is met as a whole gives to the pixel, W/m², mean of the channels.
float light_share(uint i, vec3 position, vec3 normal) {
    VirtualLight light = lights[i];
    return dot(radiosities[i].rgb, vec3(1.0 / 3.0))
        * max(far_form_factor(position, normal, light.v0, light.v1, light.v2, light.area_vector), 0.0);
}

float cluster_share(uint i, vec3 position, vec3 normal) {
    return dot(clusters[i].power, vec3(1.0 / 3.0)) * cluster_factor(nodes[i], clusters[i], position, normal);
}

// A light of a picked cluster, or NO_PICK where none of its lights gives anything.
uint light_of_cluster(uint pick, vec3 position, vec3 normal, inout float number) {
    while (pick != NO_PICK && (pick & PICKED_CLUSTER) != 0u) {
        LightNode node = nodes[pick & ~PICKED_CLUSTER];
        Choice choice = Choice(NO_PICK, 0.0, number);
        for (uint i = node.first_child; i < node.end_child; ++i) {
            meet_share(choice, PICKED_CLUSTER | i, cluster_share(i, position, normal));
        }
        for (uint i = node.first_light; i < node.end_light; ++i) {
            meet_share(choice, light_ids[i], light_share(light_ids[i], position, normal));
        }
        pick = choice.id;
        number = choice.number;
    }
    return pick;
}
#endif

// A sample of a light in proportion to what its piece gives, or its first with HIDDEN_POINT where all face away.
uint point_of_light(uint light, vec3 position, vec3 normal, vec3 geometric_normal, float number) {
    uint first = point_offsets[light], end = point_offsets[light + 1u];
    Choice choice = Choice(first < end ? HIDDEN_POINT | first : NO_PICK, 0.0, number);
    for (uint i = first; i < end; ++i) {
        LightPoint point = points[i];
        vec3 way = point.position - position;
        float squared = max(dot(way, way), 1e-18);
        bool leaves = dot(geometric_normal, way) > 0.0;
        float cosines = max(dot(normal, way), 0.0) * max(-dot(point.normal, way), 0.0) / squared;
        meet_share(choice, i, leaves ? point.weight * cosines / squared : 0.0);
    }
    return choice.id;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(met);
    if (any(greaterThanEqual(pixel, size)) || !pixel_shows_geometry(pixel)) {
        return;
    }
    uint index = gl_WorkGroupID.z;
    uint at = uint(pixel.y * size.x + pixel.x) * (4u * PICK_GROUPS) + index;
    // Where nothing was met nothing was written.
    uint pick = imageLoad(met, pixel).r > 0.0 ? picks[at] : NO_PICK;
    if (pick != NO_PICK) {
        vec3 position = texelFetch(gbuffer_position, pixel, 0).xyz;
        vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
        float number = spread_pattern(uvec2(pixel), index, sample_index).y;
#if CLUSTERED
        pick = light_of_cluster(pick, position, normal, number);
#endif
        if (pick != NO_PICK) {
            vec3 geometric_normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
            pick = point_of_light(pick, position, normal, geometric_normal, number);
        }
    }
    picks[at] = pick;
}
