// SPDX-License-Identifier: GPL-3.0-or-later
// The pixels of one invocation of a work group that shades a square tile of the picture.
#ifndef PASSES_TILE_PIXELS
#define PASSES_TILE_PIXELS
#include "passes/gbuffer_samplers.glsl"
#include "passes/light_tags.glsl"
#include "lib/light_classes.glsl"

#define GROUP_SIZE (GROUP_SIDE * GROUP_SIDE)
#define PIXELS (PIXELS_PER_SIDE * PIXELS_PER_SIDE)

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

// Bounds of each tile's surfaces, row by row of tiles; half_extent.x is negative where it has none.
layout(std430, binding = TILE_BINDING) TILE_ACCESS buffer Tiles { PointGroup tiles[]; };

uniform int tiles_across;
uniform ivec2 picture_size;

// Those without surface repeat one that has, or have a normal of zero.
vec3 positions[PIXELS];
vec3 normals[PIXELS];
int tag_ids[PIXELS];
bool shown[PIXELS];

// Whether a light of a tag leaves out the k-th pixel's surface.
#ifdef NO_TAGS
#define IS_LEFT_OUT(TAG, K) false
#else
#define IS_LEFT_OUT(TAG, K) LEAVES_OUT(TAG, tag_ids[K])
#endif

ivec2 pixel_at(uint tile, int k) {
    ivec2 corner = ivec2(int(tile) % tiles_across, int(tile) / tiles_across) * (GROUP_SIDE * PIXELS_PER_SIDE);
    return corner + ivec2(gl_LocalInvocationID.xy) + GROUP_SIDE * ivec2(k % PIXELS_PER_SIDE, k / PIXELS_PER_SIDE);
}

void fetch_pixels(uint tile) {
    for (int k = 0; k < PIXELS; ++k) {
        ivec2 pixel = pixel_at(tile, k);
        shown[k] = all(lessThan(pixel, picture_size)) && pixel_shows_geometry(pixel);
        pixel = min(pixel, picture_size - 1);
        positions[k] = texelFetch(gbuffer_position, pixel, 0).xyz;
        normals[k] = shown[k] ? texelFetch(gbuffer_shading_normal, pixel, 0).xyz : vec3(0.0);
        tag_ids[k] = texelFetch(gbuffer_ids, pixel, 0).y;
    }
}
#endif
