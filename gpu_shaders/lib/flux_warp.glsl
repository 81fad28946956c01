// SPDX-License-Identifier: GPL-3.0-or-later
// Points of the unit square warped by the flux of a map; float32 form of vlm_addon/core/flux_warp.py.
#ifndef LIB_FLUX_WARP
#define LIB_FLUX_WARP
#include "lib/halton.glsl"

// Sum of the channels that a texel of some level reflects.
float flux_importance(sampler2D flux, ivec2 texel, int level) {
    vec3 reflected = texelFetch(flux, texel, level).rgb;
    return reflected.r + reflected.g + reflected.b;
}

// Which of two parts of [0, 1), as large as their weights, holds `coordinate`: 0 or 1, never one of no weight while the
// other has some. The coordinate becomes its place in that part.
int choose_part(vec2 weights, inout float coordinate) {
    float at = coordinate * (weights.x + weights.y);
    bool is_first = weights.x > 0.0 && (at < weights.x || !(weights.y > 0.0));
    float place = is_first ? at / weights.x : (at - weights.x) / weights.y;
    coordinate = clamp(place, 0.0, BELOW_1);
    return is_first ? 0 : 1;
}

// The face of a map, column and row of its one texel in the coarsest level; `point` becomes its place in the face.
ivec2 choose_face(sampler2D flux, ivec2 faces, int level, inout vec2 point) {
    // Each row or column against all that come after it.
    ivec2 face = ivec2(0);
    for (; face.y < faces.y - 1; ++face.y) {
        vec2 weights = vec2(0.0);
        for (int y = face.y; y < faces.y; ++y) {
            for (int x = 0; x < faces.x; ++x) {
                weights[min(y - face.y, 1)] += flux_importance(flux, ivec2(x, y), level);
            }
        }
        if (choose_part(weights, point.y) == 0) {
            break;
        }
    }
    for (; face.x < faces.x - 1; ++face.x) {
        vec2 weights = vec2(0.0);
        for (int x = face.x; x < faces.x; ++x) {
            weights[min(x - face.x, 1)] += flux_importance(flux, ivec2(x, face.y), level);
        }
        if (choose_part(weights, point.x) == 0) {
            break;
        }
    }
    return face;
}

// The texel to which a point of the unit square is warped. flux: of a reflective shadow map of so many faces, whose
// `levels` mip levels are sums, down to one texel a face. Any texel where all is black.
ivec2 warped_texel(sampler2D flux, ivec2 faces, int levels, vec2 point) {
    ivec2 texel = choose_face(flux, faces, levels - 1, point);
    for (int level = levels - 2; level >= 0; --level) {
        texel *= 2;
        vec2 lower = vec2(flux_importance(flux, texel, level), flux_importance(flux, texel + ivec2(1, 0), level));
        vec2 upper = vec2(
            flux_importance(flux, texel + ivec2(0, 1), level), flux_importance(flux, texel + ivec2(1, 1), level)
        );
        int row = choose_part(vec2(lower.x + lower.y, upper.x + upper.y), point.y);
        texel += ivec2(choose_part(row == 0 ? lower : upper, point.x), row);
    }
    return texel;
}
#endif
