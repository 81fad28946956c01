// SPDX-License-Identifier: GPL-3.0-or-later
// Fills in the pixels that look like their neighbours in the low-resolution G-buffer (seed 001, 3.5) where these have
// much the same result, and marks the others.
#include "passes/gbuffer_samplers.glsl"

#define LARGE 3e38

layout(binding = LOW_POSITION_UNIT) uniform sampler2D low_position;
layout(binding = LOW_NORMAL_UNIT) uniform sampler2D low_normal;
layout(binding = LOW_RESULT_UNIT) uniform sampler2D low_result;
layout(location = 0) out vec4 out_result;
layout(location = 1) out uint out_mark;

uniform float normal_threshold;     // length of the difference of unit normals
uniform float position_threshold;   // share of the picture's width
uniform float value_threshold;      // share of the largest result around a pixel
uniform float width_at_0, width_per_depth; // of the picture, m: width_at_0 + width_per_depth x depth

// Where `pixel` lies between the two texels `low` and `low` + 1 of the low-resolution picture along one axis.
float share_between(int pixel, int low, int last) {
    int from = min(FACTOR * low, last), to = min(FACTOR * (low + 1), last);
    return to > from ? float(pixel - from) / float(to - from) : 0.0;
}

// Whether the pixel can be filled in, and with what. pixel: shows a surface.
bool blend(ivec2 pixel, out vec4 result) {
    result = vec4(0.0);
    ivec2 last = textureSize(gbuffer_position, 0) - 1;
    ivec2 low_last = textureSize(low_position, 0) - 1;
    ivec2 low = pixel / FACTOR;
    vec2 share = vec2(share_between(pixel.x, low.x, last.x), share_between(pixel.y, low.y, last.y));
    vec4 place = texelFetch(gbuffer_position, pixel, 0);
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    float reach = position_threshold * (width_at_0 + width_per_depth * place.w);
    vec4 sum = vec4(0.0);
    vec3 lowest = vec3(LARGE), highest = vec3(-LARGE);
    float total = 0.0;
    for (int k = 0; k < 4; ++k) {
        ivec2 step = ivec2(k & 1, k >> 1);
        float weight = (step.x == 1 ? share.x : 1.0 - share.x) * (step.y == 1 ? share.y : 1.0 - share.y);
        ivec2 texel = min(low + step, low_last);
        vec3 low_facing = texelFetch(low_normal, texel, 0).xyz;
        if (weight == 0.0 || !shows_geometry(low_facing)) {
            continue;
        }
        bool is_alike = distance(place.xyz, texelFetch(low_position, texel, 0).xyz) < reach
            && distance(normal, low_facing) < normal_threshold;
        if (!is_alike) {
            return false;
        }
        vec4 found = texelFetch(low_result, texel, 0);
        lowest = min(lowest, found.rgb);
        highest = max(highest, found.rgb);
        sum += weight * found;
        total += weight;
    }
    vec3 size = max(abs(lowest), abs(highest)), range = highest - lowest;
    float largest = max(max(size.r, size.g), size.b);
    if (total == 0.0 || max(max(range.r, range.g), range.b) > value_threshold * largest) {
        return false;
    }
    result = sum / total;
    return true;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_result = vec4(0.0);
    out_mark = MARK_EMPTY;
    if (pixel_shows_geometry(pixel)) {
        out_mark = blend(pixel, out_result) ? MARK_FILLED : MARK_REDONE;
    }
}
