// SPDX-License-Identifier: GPL-3.0-or-later
// One ray for each pixel, from its surface to one of its picked source samples, through the octree. Adds what the picked
// lights give to `unshadowed`, and to `shadowed` where the ray gets there (Heitz, Hill and McGuire 2018).
#include "gpu_layout/LightPoint"
#include "passes/gbuffer_samplers.glsl"
#include "lib/octree_triangles.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused
layout(std430, binding = LIGHT_POINT_BINDING) readonly buffer LightPoints { LightPoint points[]; };
layout(std430, binding = PICK_BINDING) readonly buffer Picks { uint picks[]; };
layout(std430, binding = RAY_COUNT_BINDING) buffer RayCounts { uint ray_counts[]; }; // cast, blocked

layout(rgba32f, binding = 0) uniform image2D shadowed;   // W/m²
layout(rgba32f, binding = 1) uniform image2D unshadowed; // W/m²
layout(binding = IRRADIANCE_UNIT) uniform sampler2D irradiance;

uniform uint index;         // of the pick
uniform uint pick_count;
uniform vec4 frame;         // of the octree
uniform int exact_reach;    // voxels

shared uint group_counts[2];

// Whether the ray to a picked sample is cast, and whether it gets there.
bvec2 cast_and_seen(ivec2 pixel, uint pick) {
    if ((pick & HIDDEN_POINT) != 0u) {
        return bvec2(false);
    }
    vec3 place = octree_place(texelFetch(gbuffer_position, pixel, 0).xyz, frame);
    vec3 normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    LightPoint point = points[pick];
    return bvec2(true, octree_points_see(place, normal, octree_place(point.position, frame), point.normal, exact_reach));
}

void main() {
    if (gl_LocalInvocationIndex < 2u) {
        group_counts[gl_LocalInvocationIndex] = 0u;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(shadowed);
    bool is_inside = all(lessThan(pixel, size));
    uint pick = NO_PICK;
    if (is_inside && pixel_shows_geometry(pixel)) {
        pick = picks[uint(pixel.y * size.x + pixel.x) * (4u * PICK_GROUPS) + index];
    }
    vec3 gives = vec3(0.0);
    bool seen = false;
    if (pick != NO_PICK) {
        bvec2 found = cast_and_seen(pixel, pick);
        seen = found.y;
        atomicAdd(group_counts[0], uint(found.x));
        atomicAdd(group_counts[1], uint(found.x && !found.y));
        vec3 radiosity = radiosities[points[pick & ~HIDDEN_POINT].light].rgb;
        float total = dot(texelFetch(irradiance, pixel, 0).rgb, vec3(1.0 / 3.0));
        gives = radiosity * (total / (max(dot(radiosity, vec3(1.0 / 3.0)), 1e-30) * float(pick_count)));
    }
    if (is_inside) {
        vec4 before = index > 0u ? imageLoad(unshadowed, pixel) : vec4(0.0);
        vec4 seen_before = index > 0u ? imageLoad(shadowed, pixel) : vec4(0.0);
        imageStore(unshadowed, pixel, before + vec4(gives, 0.0));
        imageStore(shadowed, pixel, seen_before + vec4(seen ? gives : vec3(0.0), 0.0));
    }
    barrier();
    if (gl_LocalInvocationIndex < 2u) {
        atomicAdd(ray_counts[gl_LocalInvocationIndex], group_counts[gl_LocalInvocationIndex]);
    }
}
