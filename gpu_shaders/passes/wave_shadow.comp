// SPDX-License-Identifier: GPL-3.0-or-later
// Adds to every pixel the shadows of one map of a wave's light, or of a pair of maps and steps in between (seed 000,
// 4.3).
#include "passes/gbuffer_samplers.glsl"
#include "lib/shadow.glsl"

// Between neighbouring facets of a curved surface, radians.
#define FACET_TILT 0.05

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;
layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(binding = FIRST_MAP_UNIT) uniform sampler2D first_map;
#if IS_PAIR
layout(binding = SECOND_MAP_UNIT) uniform sampler2D second_map;

uniform int steps;  // between the two maps
#endif
layout(r32f, binding = 0) uniform image2D visibility;

uniform float share;    // one over the number of all shadows

// Share of a lamp that a point sees; 1 where its map does not look.
float seen_share(sampler2D map, Lamp lamp, vec3 position, vec3 normal) {
    vec3 place = (position - lamp.shadow_origin) * mat3(lamp.x_axis, lamp.y_axis, -lamp.z_axis);
    if (place.z <= 0.0 || any(greaterThan(abs(place.xy), lamp.shadow_extent * place.z))) {
        return 1.0;
    }
    return lit_share(map, lamp, position, normal, FACET_TILT);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(visibility))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    vec3 p = texelFetch(gbuffer_position, pixel, 0).xyz;
    vec3 n = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
#if IS_PAIR
    mat3 first_axes = mat3(lamps[0].x_axis, lamps[0].y_axis, lamps[0].z_axis);
    mat3 second_axes = mat3(lamps[1].x_axis, lamps[1].y_axis, lamps[1].z_axis);
    vec3 first_place = (p - lamps[0].shadow_origin) * first_axes, first_normal = n * first_axes;
    vec3 second_place = (p - lamps[1].shadow_origin) * second_axes, second_normal = n * second_axes;
    float sum = 0.0;
    for (int i = 0; i < steps + 2; ++i) {
        // Where the point would be in the map's own space; the nearer map is asked.
        float along = float(i) / float(steps + 1);
        vec3 place = mix(first_place, second_place, along);
        vec3 normal = mix(first_normal, second_normal, along);
        normal *= inversesqrt(max(dot(normal, normal), 1e-30));
        if (2 * i < steps + 1) {
            sum += seen_share(first_map, lamps[0], lamps[0].shadow_origin + first_axes * place, first_axes * normal);
        } else {
            sum += seen_share(second_map, lamps[1], lamps[1].shadow_origin + second_axes * place, second_axes * normal);
        }
    }
#else
    float sum = seen_share(first_map, lamps[0], p, n);
#endif
    imageStore(visibility, pixel, imageLoad(visibility, pixel) + share * sum);
}
