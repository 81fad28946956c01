// SPDX-License-Identifier: GPL-3.0-or-later
// Adds to every pixel what it sees of a run of its tile's virtual point lights (seed 004, 3.3 and 4.10, eq. 3.1).
#include "passes/gbuffer_samplers.glsl"
#include "gpu_layout/VirtualPointLight"
#include "lib/vpl.glsl"
#if IS_OCCLUDED
#include "lib/octree_triangles.glsl"
#endif

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = LIGHT_BINDING) readonly buffer Lights { VirtualPointLight lights[]; };
layout(rgba32f, binding = 0) uniform image2D irradiance; // W/m²; w: ways asked for

uniform ivec2 tile_size;    // pixels
uniform int tiles_across;
uniform uint tile_lights;   // each tile has so many, the next tile the next ones
uniform uint first, end;    // run of a tile's lights
uniform float gain;         // a tile's lights stand for all
uniform float least;        // W/m², mean of the channels: a light that brings less is left out
#if IS_OCCLUDED
layout(std430, binding = CUT_BINDING) buffer Cut { uint cut; }; // loops that ended before their time
uniform vec4 octree_frame;
uniform int exact_reach;    // voxels
#endif

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(irradiance))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    ivec2 tile = pixel / tile_size;
    uint start = uint(tile.y * tiles_across + tile.x) * tile_lights;
    vec3 p = texelFetch(gbuffer_position, pixel, 0).xyz;
    vec3 n = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 facet = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
#if IS_OCCLUDED
    vec3 place = octree_place(p, octree_frame);
#endif
    vec4 sum = vec4(0.0);
    uint done = 0u;
    for (uint i = start + first; i < start + end; ++i) {
        VirtualPointLight light = lights[i];
        ++done;
        vec3 brought = gain * piece_geometry(p, n, light.position, light.normal, light.area) * light.flux;
        vec3 towards = light.position - p;
        bool faces = dot(towards, facet) > 0.0 && dot(towards, light.geometric_normal) < 0.0;
        if (!faces || dot(brought, vec3(1.0 / 3.0)) <= least) {
            continue;
        }
#if IS_OCCLUDED
        vec3 other = octree_place(light.position, octree_frame);
        sum.w += 1.0;
        if (!octree_points_see(place, facet, other, light.geometric_normal, exact_reach)) {
            continue;
        }
#endif
        sum.rgb += brought;
    }
#if IS_OCCLUDED
    if (done < end - first) {
        atomicAdd(cut, 1u);
    }
#endif
    imageStore(irradiance, pixel, imageLoad(irradiance, pixel) + sum);
}
