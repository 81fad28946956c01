// SPDX-License-Identifier: GPL-3.0-or-later
// The G-buffer as n x n tiles of every n-th pixel (seed 004, 4.6).
#include "passes/gbuffer_samplers.glsl"
#include "lib/interleave.glsl"

layout(location = 0) out vec4 out_position;
layout(location = 1) out vec4 out_shading_normal;
layout(location = 2) out vec4 out_geometric_normal;
layout(location = 3) out ivec4 out_ids;
layout(location = 4) out ivec2 out_pixel;

uniform ivec2 tile_size;

void main() {
    out_pixel = interleaved_pixel(ivec2(gl_FragCoord.xy), INTERLEAVE, tile_size);
    if (any(greaterThanEqual(out_pixel, textureSize(gbuffer_position, 0)))) {
        out_position = out_shading_normal = out_geometric_normal = vec4(0.0);
        out_ids = ivec4(0);
        return;
    }
    out_position = texelFetch(gbuffer_position, out_pixel, 0);
    out_shading_normal = texelFetch(gbuffer_shading_normal, out_pixel, 0);
    out_geometric_normal = texelFetch(gbuffer_geometric_normal, out_pixel, 0);
    out_ids = texelFetch(gbuffer_ids, out_pixel, 0);
}
