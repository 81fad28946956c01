// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of every pixel from a run of virtual lights, added to what earlier runs gave (seed 002, 3.3 and eq. 3.1):
// of all lights, or (LISTED) of the list of the pixel's tile, each with the weight of its cluster's window. Or (PICKS)
// some of these lights.
// A work group shades a tile of pixels and sorts the lights into classes that hold for all of the tile.
#include "gpu_layout/VirtualLight"
#define TILE_ACCESS readonly
#include "passes/tile_pixels.glsl"
#include "passes/tile_lists.glsl"
#include "passes/light_sum.glsl"
#include "lib/light_cluster.glsl"

#define CLASSES 3
#define WORDS (GROUP_SIZE / 32)

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused
#if LISTED
// Centroid and window of the cluster that each light is in.
layout(std430, binding = LIGHT_WINDOW_BINDING) readonly buffer LightWindows { vec4 light_windows[]; };
#define WEIGHT(LIGHT, POINT) window_weight(POINT, light_windows[LIGHT].xyz, light_windows[LIGHT].w)
#else
#define WEIGHT(LIGHT, POINT) 1.0
#endif

// One bit for each light of a batch, by class.
shared uint members[CLASSES * WORDS];
#if BAKED
// One bit for each light of a batch that all of the tile sees whole.
shared uint wholes[WORDS];
#define LOOK_AT(WORD, BIT) is_whole = (wholes[WORD] >> BIT & 1u) != 0u
#else
#define LOOK_AT(WORD, BIT)
#endif

// Sorts the GROUP_SIZE lights from `first` on into `members`, one for each invocation.
void classify(PointGroup group, uint first, uint end) {
    uint index = gl_LocalInvocationIndex;
    if (index < uint(CLASSES * WORDS)) {
        members[index] = 0u;
    }
#if BAKED
    if (index < uint(WORDS)) {
        wholes[index] = 0u;
    }
#endif
    barrier();
    uint at = first + index;
    if (at < end) {
        VirtualLight light = lights[entry(at)];
        int class_of_light =
            light_class(group, light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius);
#if BAKED
        int seen = class_of_light == LIGHT_GIVES_NOTHING ? TILE_SEES_NOTHING : tile_sees(entry(at));
        class_of_light = seen == TILE_SEES_NOTHING ? LIGHT_GIVES_NOTHING : class_of_light;
        if (seen == TILE_SEES_WHOLE) {
            atomicOr(wholes[index / 32u], 1u << (index % 32u));
        }
#endif
        if (class_of_light != LIGHT_GIVES_NOTHING) {
            atomicOr(members[uint(class_of_light - 1) * WORDS + index / 32u], 1u << (index % 32u));
        }
    }
    barrier();
}

#define ADD_MEMBERS(CLASS, FORM_FACTOR) \
    for (int word = 0; word < WORDS; ++word) { \
        uint bits = members[(CLASS - 1) * WORDS + word]; \
        while (bits != 0u) { \
            int bit = findLSB(bits); \
            uint i = entry(first + uint(32 * word + bit)); \
            bits &= bits - 1u; \
            LOOK_AT(word, bit); \
            VirtualLight light = lights[i]; \
            vec3 radiosity = radiosities[i].rgb; \
            for (int k = 0; k < PIXELS; ++k) { \
                float factor = WEIGHT(i, positions[k]) * FORM_FACTOR; \
                meet(k, i, IS_LEFT_OUT(light.tag_id, k) ? vec3(0.0) : factor * radiosity); \
            } \
        } \
    }

void main() {
    uint tile = this_tile();
    uvec2 run = this_run();
    PointGroup group = tiles[tile];
    if (run.x >= run.y || group.half_extent.x < 0.0) {
        return;
    }
    fetch_pixels(tile);
    start_sums(tile);
#if BAKED
    gather_tile_rows();
#endif
    for (uint first = run.x; first < run.y; first += GROUP_SIZE) {
        classify(group, first, run.y);
        start_batch();
        ADD_MEMBERS(LIGHT_IS_FAR,
            far_form_factor(positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector))
        ADD_MEMBERS(LIGHT_IS_WHOLE,
            whole_form_factor(
                positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius))
        ADD_MEMBERS(LIGHT_IS_CLIPPED,
            triangle_form_factor(
                positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius))
        end_batch();
        barrier();
    }
    store_sums(tile);
}
