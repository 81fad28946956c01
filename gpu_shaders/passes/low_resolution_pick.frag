// SPDX-License-Identifier: GPL-3.0-or-later
// Some pixels of the G-buffer as another one, and which they are. (SHRINKS) every FACTOR-th pixel in both directions and
// the last ones, or the nearest pixel to those that shows a surface, so that every pixel that shows one has a neighbour
// that does. Else those of a list, each run of GROUP_SIDE² of it in a square of that side.
#include "passes/gbuffer_samplers.glsl"

#if !SHRINKS
layout(std430, binding = LIST_BINDING) readonly buffer List { ivec2 listed[]; };
uniform uint count; // of pixels in the list
#endif

layout(location = 0) out vec4 out_position;
layout(location = 1) out vec4 out_shading_normal;
layout(location = 2) out vec4 out_geometric_normal;
layout(location = 3) out vec4 out_base_color;
layout(location = 4) out vec4 out_emission;
layout(location = 5) out ivec4 out_ids;
layout(location = 6) out ivec2 out_pixel;

#if SHRINKS
ivec2 picked_pixel(ivec2 texel) {
    ivec2 last = textureSize(gbuffer_position, 0) - 1;
    ivec2 place = min(FACTOR * texel, last);
    if (pixel_shows_geometry(place)) {
        return place;
    }
    ivec2 best = place;
    int least = 2 * FACTOR * FACTOR;
    for (int y = 1 - FACTOR; y < FACTOR; ++y) {
        for (int x = 1 - FACTOR; x < FACTOR; ++x) {
            ivec2 pixel = place + ivec2(x, y);
            bool inside = all(greaterThanEqual(pixel, ivec2(0))) && all(lessThanEqual(pixel, last));
            if (inside && x * x + y * y < least && pixel_shows_geometry(pixel)) {
                least = x * x + y * y;
                best = pixel;
            }
        }
    }
    return best;
}
#else
// -1 beyond the list.
ivec2 picked_pixel(ivec2 texel) {
    uint columns = uint(textureSize(gbuffer_position, 0).x + GROUP_SIDE - 1) / uint(GROUP_SIDE);
    uvec2 square = uvec2(texel) / uint(GROUP_SIDE), within = uvec2(texel) % uint(GROUP_SIDE);
    uint place = (square.y * columns + square.x) * uint(GROUP_SIDE * GROUP_SIDE) + within.y * uint(GROUP_SIDE) + within.x;
    return place < count ? listed[place] : ivec2(-1);
}
#endif

void main() {
    out_pixel = picked_pixel(ivec2(gl_FragCoord.xy));
    if (out_pixel.x < 0) {
        out_position = out_shading_normal = out_geometric_normal = out_base_color = out_emission = vec4(0.0);
        out_ids = ivec4(0);
        return;
    }
    out_position = texelFetch(gbuffer_position, out_pixel, 0);
    out_shading_normal = texelFetch(gbuffer_shading_normal, out_pixel, 0);
    out_geometric_normal = texelFetch(gbuffer_geometric_normal, out_pixel, 0);
    out_base_color = texelFetch(gbuffer_base_color, out_pixel, 0);
    out_emission = texelFetch(gbuffer_emission, out_pixel, 0);
    out_ids = texelFetch(gbuffer_ids, out_pixel, 0);
}
