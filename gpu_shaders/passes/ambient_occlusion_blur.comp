// SPDX-License-Identifier: GPL-3.0-or-later
// The openness of a pixel from its sums, as a mean over the pixels around that show the same surface: any 4 x 4 of them
// together have all directions of the kernel, so each residue of 4 counts once along each axis.
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = SUMS_UNIT) uniform sampler2D sums; // open directions, and all; by weight
layout(r32f, binding = 0) writeonly uniform image2D result; // 1 open, 0 closed

uniform int reach;              // pixels to each side
uniform float least_cosine;     // of the angle between normals of what is one surface
uniform float plane_distance;   // m, from either pixel's plane
uniform float distance_limit;   // m, from the pixel's place

bool is_one_surface(ivec2 pixel, ivec2 other) {
    vec3 plane = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    vec3 other_plane = texelFetch(gbuffer_geometric_normal, other, 0).xyz;
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 way = texelFetch(gbuffer_position, other, 0).xyz - texelFetch(gbuffer_position, pixel, 0).xyz;
    return shows_geometry(other_plane) && dot(normal, texelFetch(gbuffer_shading_normal, other, 0).xyz) >= least_cosine
        && length(way) <= distance_limit
        && abs(dot(way, plane)) <= plane_distance && abs(dot(way, other_plane)) <= plane_distance;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(result);
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    vec2 sum = vec2(0.0);
    bool shows = pixel_shows_geometry(pixel);
    int side = 2 * reach + 1;
    for (int k = shows ? 0 : side * side; k < side * side; ++k) {
        ivec2 away = ivec2(k % side, k / side) - reach;
        ivec2 other = pixel + away;
        bool is_inside = all(greaterThanEqual(other, ivec2(0))) && all(lessThan(other, size));
        if (away == ivec2(0) || is_inside && is_one_surface(pixel, other)) {
            vec2 share = 1.0 - 0.5 * vec2(equal(abs(away), ivec2(BLUR_REACH)));
            vec2 found = texelFetch(sums, other, 0).xy;
            sum += share.x * share.y * vec2(found.y > 0.0 ? found.x / found.y : 1.0, 1.0);
        }
    }
    imageStore(result, pixel, vec4(shows ? clamp(sum.x / sum.y, 0.0, 1.0) : 1.0));
}
