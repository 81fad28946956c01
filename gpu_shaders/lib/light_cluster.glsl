// SPDX-License-Identifier: GPL-3.0-or-later
// A cluster of virtual lights: where it stands for them, what it gives then, and which points none of them lights.
// float32 form of vlm_addon/core/light_clusters.py and light_cut.py, where the reasons are.
#ifndef LIB_LIGHT_CLUSTER
#define LIB_LIGHT_CLUSTER
#include "lib/light_classes.glsl"
#include "gpu_layout/LightNode"
#include "gpu_layout/LightCluster"

// How much a cluster's lights count instead of it at p: 1 up to `window` from its centre, 0 from (1 + CLUSTER_FADE)
// times that on.
float window_weight(vec3 p, vec3 centre, float window) {
    float t = clamp((length(p - centre) / window - 1.0) * (1.0 / CLUSTER_FADE), 0.0, 1.0);
    return 1.0 - t * t * (3.0 - 2.0 * t);
}

// How much a cluster counts at p: where its parent is opened and it is not itself.
float cluster_weight(LightNode node, LightCluster cluster, vec3 p) {
    float outer = window_weight(p, cluster.parent_centre, cluster.parent_window);
    return max(outer - window_weight(p, node.centre, node.window), 0.0);
}

// No light of the cluster is farther in front of its own plane, seen from p, than this; m.
float most_in_front(LightNode node, vec3 p) {
    vec3 q = p - node.centre;
    float along = dot(q, node.axis), distance = length(q), across = length(q - along * node.axis);
    bool within_cone = along >= distance * node.cone_cos;
    return (within_cone ? distance : along * node.cone_cos + across * node.cone_sin) - node.plane;
}

// No corner of the cluster's lights is higher over the horizon of p with normal n than this; m.
float greatest_height(LightNode node, vec3 p, vec3 n) {
    return dot(n, node.middle - p) + dot(abs(n), node.half_extent);
}

// max(0, value), rounded off by a parabola within `width` of 0.
float softened(float value, float width) {
    float safe_width = max(width, 1e-30);
    float inside = clamp(value + safe_width, 0.0, 2.0 * safe_width);
    return value > safe_width ? value : inside * (inside / (4.0 * safe_width));
}

// Irradiance at p with unit normal n for each watt that the cluster sends out, 1/m²: its power is at four points, and
// the normals vary as its lights' do. At most 1 / (pi least_squared), exactly 0 where no light of it can give any.
float cluster_factor(LightNode node, LightCluster cluster, vec3 p, vec3 n) {
    float front = max(most_in_front(node, p), 0.0);
    float height = max(greatest_height(node, p, n), 0.0);
    float sum = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec3 offset = (k & 2) == 0 ? cluster.first_axis : cluster.second_axis;
        vec3 towards = cluster.mean + ((k & 1) == 0 ? offset : -offset) - p;
        float squared = max(max(dot(towards, towards), cluster.least_squared), 1e-30);
        vec3 squares = towards * towards, products = towards.xyx * towards.yzz;
        float variance = dot(squares, cluster.variances) + 2.0 * dot(products, cluster.covariances);
        float width = CLUSTER_SOFTNESS * sqrt(max(variance, 0.0));
        float emitted = min(softened(-dot(towards, cluster.normal), width), min(sqrt(squared), front));
        float received = clamp(dot(towards, n), 0.0, height);
        float inverse = 1.0 / squared;
        sum += (received * inverse) * (emitted * inverse);
    }
    return sum * (0.25 / FORM_FACTOR_PI);
}

// Whether no light of the cluster, nor the cluster itself, lights any point of the group.
bool cluster_gives_nothing(PointGroup group, LightNode node) {
    float group_radius = length(group.half_extent);
    // Over normals of the cone, none of which leans more from its axis than it opens.
    float lean = sqrt(max(2.0 - 2.0 * node.cone_cos, 0.0)) * group_radius;
    float nearer = min(dot(abs(node.axis), group.half_extent) + lean, group_radius);
    if (most_in_front(node, group.centre) + nearer <= 0.0) {
        return true;
    }
    float height = dot(group.axis, node.middle) + dot(abs(group.axis), node.half_extent) - group.lowest;
    float sin_spread = sqrt(max(1.0 - group.cos_spread * group.cos_spread, 0.0));
    float farthest = length(node.middle - group.centre) + group_radius + length(node.half_extent);
    return group.cos_spread > 0.0 && group.cos_spread * height + sin_spread * farthest <= 0.0;
}

// Least and greatest distance of a point of the group's box from p, m.
vec2 distance_range(PointGroup group, vec3 p) {
    vec3 apart = abs(p - group.centre);
    return vec2(length(max(apart - group.half_extent, 0.0)), length(apart + group.half_extent));
}
#endif
