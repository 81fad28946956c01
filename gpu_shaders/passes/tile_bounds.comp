// SPDX-License-Identifier: GPL-3.0-or-later
// Bounds of the surfaces that each tile of the picture shows.
#define TILE_ACCESS writeonly
#include "passes/tile_pixels.glsl"

shared vec3 shared_low[GROUP_SIZE];
shared vec3 shared_high[GROUP_SIZE];
shared vec3 shared_normal[GROUP_SIZE];
shared vec2 shared_range[GROUP_SIZE];
shared float shared_cos[GROUP_SIZE];

void main() {
    uint tile = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    fetch_pixels(tile);
    uint index = gl_LocalInvocationIndex;
    vec3 low = vec3(1e30), high = vec3(-1e30), normal = vec3(0.0);
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            low = min(low, positions[k]);
            high = max(high, positions[k]);
            normal += normals[k];
        }
    }
    shared_low[index] = low;
    shared_high[index] = high;
    shared_normal[index] = normal;
    barrier();
    for (uint half_size = GROUP_SIZE / 2; half_size > 0u; half_size /= 2u) {
        if (index < half_size) {
            shared_low[index] = min(shared_low[index], shared_low[index + half_size]);
            shared_high[index] = max(shared_high[index], shared_high[index + half_size]);
            shared_normal[index] += shared_normal[index + half_size];
        }
        barrier();
    }
    PointGroup group;
    group.centre = 0.5 * (shared_low[0] + shared_high[0]);
    group.half_extent = 0.5 * (shared_high[0] - shared_low[0]);
    vec3 mean_normal = shared_normal[0];
    group.axis = dot(mean_normal, mean_normal) > 0.0 ? normalize(mean_normal) : vec3(0.0, 0.0, 1.0);

    vec2 range = vec2(1e30, -1e30);
    float least_cos = 1.0;
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            float along_axis = dot(group.axis, positions[k]);
            range = vec2(min(range.x, along_axis), max(range.y, along_axis));
            least_cos = min(least_cos, dot(group.axis, normals[k]));
        }
    }
    shared_range[index] = range;
    shared_cos[index] = least_cos;
    barrier();
    for (uint half_size = GROUP_SIZE / 2; half_size > 0u; half_size /= 2u) {
        if (index < half_size) {
            vec2 other = shared_range[index + half_size];
            shared_range[index] = vec2(min(shared_range[index].x, other.x), max(shared_range[index].y, other.y));
            shared_cos[index] = min(shared_cos[index], shared_cos[index + half_size]);
        }
        barrier();
    }
    group.lowest = shared_range[0].x;
    group.highest = shared_range[0].y;
    group.cos_spread = shared_cos[0];
    if (index == 0u) {
        tiles[tile] = group;
    }
}
