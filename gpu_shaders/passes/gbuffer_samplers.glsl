// SPDX-License-Identifier: GPL-3.0-or-later
// The G-buffer's textures as the passes after it read them.
#ifndef PASSES_GBUFFER_SAMPLERS
#define PASSES_GBUFFER_SAMPLERS
#include "lib/gbuffer.glsl"

layout(binding = GBUFFER_POSITION_UNIT) uniform sampler2D gbuffer_position;
layout(binding = GBUFFER_SHADING_NORMAL_UNIT) uniform sampler2D gbuffer_shading_normal;
layout(binding = GBUFFER_GEOMETRIC_NORMAL_UNIT) uniform sampler2D gbuffer_geometric_normal;
layout(binding = GBUFFER_BASE_COLOR_UNIT) uniform sampler2D gbuffer_base_color;
layout(binding = GBUFFER_EMISSION_UNIT) uniform sampler2D gbuffer_emission;
layout(binding = GBUFFER_IDS_UNIT) uniform isampler2D gbuffer_ids;

bool pixel_shows_geometry(ivec2 pixel) {
    return shows_geometry(texelFetch(gbuffer_geometric_normal, pixel, 0).xyz);
}

Surface fetch_surface(ivec2 pixel) {
    return unpack_surface(
        texelFetch(gbuffer_position, pixel, 0), texelFetch(gbuffer_shading_normal, pixel, 0),
        texelFetch(gbuffer_geometric_normal, pixel, 0), texelFetch(gbuffer_base_color, pixel, 0),
        texelFetch(gbuffer_emission, pixel, 0), texelFetch(gbuffer_ids, pixel, 0)
    );
}
#endif
