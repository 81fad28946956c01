// SPDX-License-Identifier: GPL-3.0-or-later
// Nearness of an occluder to its lamp: near / distance, or the height towards the sun in m. Blending keeps the largest,
// since float32 holds it better than a depth buffer of 24 bits.
#ifdef HAS_ALPHA
#include "gpu_layout/Material"
#include "lib/hash.glsl"
#include "lib/surface.glsl"

layout(std430, binding = MATERIAL_BINDING) readonly buffer Materials { Material materials[]; };
layout(binding = ALPHA_UNIT) uniform sampler2D alpha_map;

uniform uint sample_index;

in vec2 uv;
flat in ivec2 triangle_ids;
#endif

uniform bool is_parallel;
uniform float shadow_near;

in float height;

layout(location = 0) out float nearness;

void main() {
#ifdef HAS_ALPHA
    Material material = materials[triangle_ids.x];
    float alpha = material.alpha;
    if (has_bit(material.flags, 1u << ALPHA_UNIT)) {
        alpha *= texture(alpha_map, uv)[material.alpha_channel];
    }
    if (alpha < 1.0 && spread_random(uvec2(gl_FragCoord.xy), uint(triangle_ids.y), sample_index) >= alpha) {
        discard;
    }
#endif
    nearness = is_parallel ? height : shadow_near * gl_FragCoord.w;
}
