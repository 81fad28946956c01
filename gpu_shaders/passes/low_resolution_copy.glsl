// SPDX-License-Identifier: GPL-3.0-or-later
// Picks pixels of the G-buffer into another one, and notes which they were.
#ifndef PASSES_LOW_RESOLUTION_COPY
#define PASSES_LOW_RESOLUTION_COPY
#include "passes/gbuffer_samplers.glsl"

layout(rgba32f, binding = 0) writeonly uniform image2D picked_position;
layout(rgba32f, binding = 1) writeonly uniform image2D picked_shading_normal;
layout(rgba32f, binding = 2) writeonly uniform image2D picked_geometric_normal;
layout(rgba32f, binding = 3) writeonly uniform image2D picked_base_color;
layout(rgba32f, binding = 4) writeonly uniform image2D picked_emission;
layout(rgba32i, binding = 5) writeonly uniform iimage2D picked_ids;
layout(rg32i, binding = 6) writeonly uniform iimage2D picked_pixel;

void pick(ivec2 pixel, ivec2 texel) {
    imageStore(picked_position, texel, texelFetch(gbuffer_position, pixel, 0));
    imageStore(picked_shading_normal, texel, texelFetch(gbuffer_shading_normal, pixel, 0));
    imageStore(picked_geometric_normal, texel, texelFetch(gbuffer_geometric_normal, pixel, 0));
    imageStore(picked_base_color, texel, texelFetch(gbuffer_base_color, pixel, 0));
    imageStore(picked_emission, texel, texelFetch(gbuffer_emission, pixel, 0));
    imageStore(picked_ids, texel, texelFetch(gbuffer_ids, pixel, 0));
    imageStore(picked_pixel, texel, ivec4(pixel, 0, 0));
}
#endif
