// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of every pixel from a run of virtual lights, added to what earlier runs gave (seed 002, 3.3 and eq. 3.1).
// A work group shades a tile of pixels and sorts the lights into classes that hold for all of the tile.
#include "gpu_layout/VirtualLight"
#include "passes/gbuffer_samplers.glsl"
#include "lib/light_classes.glsl"

#define GROUP_SIZE (GROUP_SIDE * GROUP_SIDE)
#define PIXELS (PIXELS_PER_SIDE * PIXELS_PER_SIDE)
#define CLASSES 3
#define WORDS (GROUP_SIZE / 32)

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused

layout(rgba32f, binding = 0) uniform image2D irradiance; // W/m²

uniform int first_light;
uniform int end_light;

shared vec3 shared_low[GROUP_SIZE];
shared vec3 shared_high[GROUP_SIZE];
shared vec3 shared_normal[GROUP_SIZE];
shared vec2 shared_range[GROUP_SIZE];
shared float shared_cos[GROUP_SIZE];
// One bit for each light of a batch, by class.
shared uint members[CLASSES * WORDS];

// The pixels of this invocation. Those without surface repeat one that has, or have a normal of zero.
vec3 positions[PIXELS];
vec3 normals[PIXELS];
int tag_ids[PIXELS];
bool shown[PIXELS];
vec3 sums[PIXELS];
// Of one batch of lights, added to `sums` at its end: a plain sum over 100,000 lights would lose digits.
vec3 batch_sums[PIXELS];

ivec2 pixel_at(int k) {
    ivec2 tile = ivec2(gl_WorkGroupID.xy) * (GROUP_SIDE * PIXELS_PER_SIDE);
    return tile + ivec2(gl_LocalInvocationID.xy) + GROUP_SIDE * ivec2(k % PIXELS_PER_SIDE, k / PIXELS_PER_SIDE);
}

void fetch_pixels() {
    ivec2 size = imageSize(irradiance);
    for (int k = 0; k < PIXELS; ++k) {
        ivec2 pixel = pixel_at(k);
        shown[k] = all(lessThan(pixel, size)) && pixel_shows_geometry(pixel);
        pixel = min(pixel, size - 1);
        positions[k] = texelFetch(gbuffer_position, pixel, 0).xyz;
        normals[k] = shown[k] ? texelFetch(gbuffer_shading_normal, pixel, 0).xyz : vec3(0.0);
        tag_ids[k] = texelFetch(gbuffer_ids, pixel, 0).y;
        sums[k] = vec3(0.0);
    }
}

// Bounds of the tile's surfaces; half_extent.x is negative where it has none.
PointGroup bound_tile() {
    uint index = gl_LocalInvocationIndex;
    vec3 low = vec3(1e30), high = vec3(-1e30), normal = vec3(0.0);
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            low = min(low, positions[k]);
            high = max(high, positions[k]);
            normal += normals[k];
        }
    }
    shared_low[index] = low;
    shared_high[index] = high;
    shared_normal[index] = normal;
    barrier();
    for (uint half_size = GROUP_SIZE / 2; half_size > 0u; half_size /= 2u) {
        if (index < half_size) {
            shared_low[index] = min(shared_low[index], shared_low[index + half_size]);
            shared_high[index] = max(shared_high[index], shared_high[index + half_size]);
            shared_normal[index] += shared_normal[index + half_size];
        }
        barrier();
    }
    PointGroup group;
    group.centre = 0.5 * (shared_low[0] + shared_high[0]);
    group.half_extent = 0.5 * (shared_high[0] - shared_low[0]);
    vec3 mean_normal = shared_normal[0];
    group.axis = dot(mean_normal, mean_normal) > 0.0 ? normalize(mean_normal) : vec3(0.0, 0.0, 1.0);

    vec2 range = vec2(1e30, -1e30);
    float least_cos = 1.0;
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            float along_axis = dot(group.axis, positions[k]);
            range = vec2(min(range.x, along_axis), max(range.y, along_axis));
            least_cos = min(least_cos, dot(group.axis, normals[k]));
        }
    }
    shared_range[index] = range;
    shared_cos[index] = least_cos;
    barrier();
    for (uint half_size = GROUP_SIZE / 2; half_size > 0u; half_size /= 2u) {
        if (index < half_size) {
            vec2 other = shared_range[index + half_size];
            shared_range[index] = vec2(min(shared_range[index].x, other.x), max(shared_range[index].y, other.y));
            shared_cos[index] = min(shared_cos[index], shared_cos[index + half_size]);
        }
        barrier();
    }
    group.lowest = shared_range[0].x;
    group.highest = shared_range[0].y;
    group.cos_spread = shared_cos[0];
    return group;
}

// Sorts the GROUP_SIZE lights from `first` on into `members`, one for each invocation.
void classify(PointGroup group, int first) {
    uint index = gl_LocalInvocationIndex;
    if (index < uint(CLASSES * WORDS)) {
        members[index] = 0u;
    }
    barrier();
    int i = first + int(index);
    if (i < end_light) {
        VirtualLight light = lights[i];
        int class_of_light =
            light_class(group, light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius);
        if (class_of_light != LIGHT_GIVES_NOTHING) {
            atomicOr(members[uint(class_of_light - 1) * WORDS + index / 32u], 1u << (index % 32u));
        }
    }
    barrier();
}

// A tagged light leaves out the surfaces of its own tag (seed 002, 3.4).
#define ADD_MEMBERS(CLASS, FORM_FACTOR) \
    for (int word = 0; word < WORDS; ++word) { \
        uint bits = members[(CLASS - 1) * WORDS + word]; \
        while (bits != 0u) { \
            int i = first + 32 * word + findLSB(bits); \
            bits &= bits - 1u; \
            VirtualLight light = lights[i]; \
            vec3 radiosity = radiosities[i].rgb; \
            for (int k = 0; k < PIXELS; ++k) { \
                float factor = FORM_FACTOR; \
                bool is_own = light.tag_id != UNTAGGED && light.tag_id == tag_ids[k]; \
                batch_sums[k] += is_own ? vec3(0.0) : factor * radiosity; \
            } \
        } \
    }

void main() {
    fetch_pixels();
    PointGroup group = bound_tile();
    if (group.half_extent.x < 0.0) {
        return;
    }
    for (int first = first_light; first < end_light; first += GROUP_SIZE) {
        classify(group, first);
        for (int k = 0; k < PIXELS; ++k) {
            batch_sums[k] = vec3(0.0);
        }
        ADD_MEMBERS(LIGHT_IS_FAR,
            far_form_factor(positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector))
        ADD_MEMBERS(LIGHT_IS_WHOLE,
            whole_form_factor(
                positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius))
        ADD_MEMBERS(LIGHT_IS_CLIPPED,
            triangle_form_factor(
                positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius))
        for (int k = 0; k < PIXELS; ++k) {
            sums[k] += batch_sums[k];
        }
        barrier();
    }
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            ivec2 pixel = pixel_at(k);
            imageStore(irradiance, pixel, vec4(imageLoad(irradiance, pixel).rgb + sums[k], 1.0));
        }
    }
}
