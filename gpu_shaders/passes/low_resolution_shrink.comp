// SPDX-License-Identifier: GPL-3.0-or-later
// The low-resolution G-buffer: of every FACTOR-th pixel in both directions and the last ones, or the nearest pixel to
// those that shows a surface, so that every pixel that shows one has a neighbour that does.
#include "passes/low_resolution_copy.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(picked_pixel)))) {
        return;
    }
    ivec2 last = textureSize(gbuffer_position, 0) - 1;
    ivec2 place = min(FACTOR * texel, last);
    ivec2 best = place;
    if (!pixel_shows_geometry(place)) {
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
    }
    pick(best, texel);
}
