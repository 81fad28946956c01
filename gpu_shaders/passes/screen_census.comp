// SPDX-License-Identifier: GPL-3.0-or-later
// How many pixels show a surface, how many a glossy one, and the bounds of what they show.
#include "passes/gbuffer_samplers.glsl"
#include "lib/brdf.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = RESULT_BINDING) buffer Census {
    uint shown;
    uint glossy;
    uint lowest[3];     // ordered bits of m
    uint highest[3];
};

// Bits in the order of the numbers that they stand for.
uint ordered_bits(float value) {
    uint bits = floatBitsToUint(value);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

bool is_glossy(Surface surface) {
    bool has_interface = surface.metallic < 1.0 && f0_from_ior(specular_ior(surface.ior, surface.specular_ior_level)) > 0.0;
    return surface.model == MODEL_PRINCIPLED && (surface.metallic > 0.0 || has_interface);
}

// Each invocation counts a block of pixels by itself: atomics of every pixel would take longer than what they save.
void main() {
    ivec2 first = ivec2(gl_GlobalInvocationID.xy) * BLOCK_SIDE;
    ivec2 end = min(first + BLOCK_SIDE, textureSize(gbuffer_position, 0));
    uint block_shown = 0u, block_glossy = 0u;
    uvec3 block_lowest = uvec3(0xffffffffu), block_highest = uvec3(0u);
    for (int y = first.y; y < end.y; ++y) {
        for (int x = first.x; x < end.x; ++x) {
            ivec2 pixel = ivec2(x, y);
            if (!pixel_shows_geometry(pixel)) {
                continue;
            }
            vec3 position = texelFetch(gbuffer_position, pixel, 0).xyz;
            uvec3 bits = uvec3(ordered_bits(position.x), ordered_bits(position.y), ordered_bits(position.z));
            block_lowest = min(block_lowest, bits);
            block_highest = max(block_highest, bits);
            ++block_shown;
#if COUNTS_GLOSSY
            block_glossy += is_glossy(fetch_surface(pixel)) ? 1u : 0u;
#endif
        }
    }
    if (block_shown == 0u) {
        return;
    }
    atomicAdd(shown, block_shown);
    atomicAdd(glossy, block_glossy);
    for (int axis = 0; axis < 3; ++axis) {
        atomicMin(lowest[axis], block_lowest[axis]);
        atomicMax(highest[axis], block_highest[axis]);
    }
}
