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

shared uint group_shown, group_glossy, group_lowest[3], group_highest[3];

// Bits in the order of the numbers that they stand for.
uint ordered_bits(float value) {
    uint bits = floatBitsToUint(value);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

bool is_glossy(Surface surface) {
    bool has_interface = surface.metallic < 1.0 && f0_from_ior(specular_ior(surface.ior, surface.specular_ior_level)) > 0.0;
    return surface.model == MODEL_PRINCIPLED && (surface.metallic > 0.0 || has_interface);
}

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        group_shown = group_glossy = 0u;
        for (int axis = 0; axis < 3; ++axis) {
            group_lowest[axis] = 0xffffffffu;
            group_highest[axis] = 0u;
        }
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, textureSize(gbuffer_position, 0))) && pixel_shows_geometry(pixel)) {
        Surface surface = fetch_surface(pixel);
        atomicAdd(group_shown, 1u);
        if (is_glossy(surface)) {
            atomicAdd(group_glossy, 1u);
        }
        for (int axis = 0; axis < 3; ++axis) {
            uint bits = ordered_bits(surface.position[axis]);
            atomicMin(group_lowest[axis], bits);
            atomicMax(group_highest[axis], bits);
        }
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u && group_shown > 0u) {
        atomicAdd(shown, group_shown);
        atomicAdd(glossy, group_glossy);
        for (int axis = 0; axis < 3; ++axis) {
            atomicMin(lowest[axis], group_lowest[axis]);
            atomicMax(highest[axis], group_highest[axis]);
        }
    }
}
