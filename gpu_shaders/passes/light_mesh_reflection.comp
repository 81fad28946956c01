// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that each pixel's specular layer sends to the eye of a run of virtual lights, added to that of earlier runs.
// A work group shades a tile of pixels and leaves out the lights that give nothing to any of them.
#include "gpu_layout/VirtualLight"
#define TILE_ACCESS readonly
#include "passes/tile_pixels.glsl"
#include "passes/reflectance.glsl"
#include "lib/ltc.glsl"

#define WORDS (GROUP_SIZE / 32)

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused
layout(rgba32f, binding = 0) uniform image2D reflected; // W/(m² sr), w 0
layout(binding = LTC_TABLE_UNIT) uniform sampler2D ltc_table;

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform uint first_light;
uniform uint end_light;

// One bit for each light of a batch: those wholly above the horizon of all of the tile, and others.
shared uint whole[WORDS];
shared uint clipped[WORDS];
shared uint is_glossy;

Surface surfaces[PIXELS];
vec3 sums[PIXELS];
bool glossy[PIXELS];

vec3 to_camera(vec3 position) {
    return is_orthographic ? camera_backward : normalize(camera_position - position);
}

bool is_glossy_to_eye(Surface surface) {
    Reflector reflector = make_reflector(surface, to_camera(surface.position), albedo_table);
    bool reflects = max(max(reflector.metal_weight.r, reflector.metal_weight.g), reflector.metal_weight.b) > 0.0
        || (reflector.dielectric_weight > 0.0 && reflector.ior != 1.0);
    return reflector.alpha > 0.0 && reflects && dot(surface.shading_normal, to_camera(surface.position)) > 0.0;
}

void classify(PointGroup group, uint first, uint end) {
    uint index = gl_LocalInvocationIndex;
    if (index < uint(WORDS)) {
        whole[index] = clipped[index] = 0u;
    }
    barrier();
    uint at = first + index;
    if (at < end && any(greaterThan(radiosities[at].rgb, vec3(0.0)))) {
        VirtualLight light = lights[at];
        int class_of_light =
            light_class(group, light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius);
        if (class_of_light == LIGHT_IS_CLIPPED) {
            atomicOr(clipped[index / 32u], 1u << (index % 32u));
        } else if (class_of_light != LIGHT_GIVES_NOTHING) {
            atomicOr(whole[index / 32u], 1u << (index % 32u));
        }
    }
    barrier();
}

// A tagged light leaves out the surfaces of its own tag (seed 002, 3.4). The loop that runs once at most is a branch
// that software renderers skip where no pixel takes it.
#define ADD_MEMBERS(MEMBERS, LOBE_SHARE) \
    for (int word = 0; word < WORDS; ++word) { \
        uint bits = MEMBERS[word]; \
        while (bits != 0u) { \
            uint i = first + uint(32 * word + findLSB(bits)); \
            bits &= bits - 1u; \
            VirtualLight light = lights[i]; \
            vec3 a = light.v0 - position, b = light.v1 - position, c = light.v2 - position; \
            bool is_own = light.tag_id != UNTAGGED && light.tag_id == surface.tag_id; \
            vec3 radiance = is_own ? vec3(0.0) : radiosities[i].rgb * INVERSE_PI; \
            float as_points = point_share(lobe, normal, (a + b + c) * (1.0 / 3.0), light.bounding_radius); \
            vec3 seen = points_reflection(reflector, normal, to_view, a, b, c, light.area_vector); \
            for (bool is_large = as_points < 1.0; is_large; is_large = false) { \
                LobeShare found = LOBE_SHARE; \
                vec3 as_polygon = lobe_reflection(lobe, reflector, normal, to_view, found); \
                seen = mix(as_polygon, seen, as_points); \
            } \
            sum += radiance * seen; \
        } \
    }

vec3 batch_reflection(Surface surface, uint first) {
    vec3 position = surface.position, normal = surface.shading_normal, to_view = to_camera(position);
    Reflector reflector = make_reflector(surface, to_view, albedo_table);
    float cos_view = dot(normal, to_view);
    // Without Fresnel, which the second channel leaves out, F0 does not matter.
    float albedo = lookup_albedo(albedo_table, 0.0, cos_view, sqrt(reflector.alpha)).y;
    vec4 fit = lookup_ltc(ltc_table, reflector.alpha, cos_view);
    LtcLobe lobe = make_ltc_lobe(fit, reflector.alpha, albedo, normal, to_view);
    vec3 sum = vec3(0.0);
    ADD_MEMBERS(whole, triangle_lobe_share(lobe, a, b, c, light.area_vector, -dot(light.area_vector, a)))
    ADD_MEMBERS(clipped, clipped_lobe_share(lobe, normal, a, b, c, light.area_vector))
    return sum;
}

void main() {
    uint tile = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    PointGroup group = tiles[tile];
    if (group.half_extent.x < 0.0) {
        return;
    }
    fetch_pixels(tile);
    if (gl_LocalInvocationIndex == 0u) {
        is_glossy = 0u;
    }
    barrier();
    for (int k = 0; k < PIXELS; ++k) {
        sums[k] = vec3(0.0);
        surfaces[k] = fetch_surface(min(pixel_at(tile, k), picture_size - 1));
        glossy[k] = shown[k] && is_glossy_to_eye(surfaces[k]);
        if (glossy[k]) {
            atomicOr(is_glossy, 1u);
        }
    }
    barrier();
    if (is_glossy == 0u) {
        return;
    }
    for (uint first = first_light; first < end_light; first += GROUP_SIZE) {
        classify(group, first, end_light);
        for (int k = 0; k < PIXELS; ++k) {
            if (glossy[k]) {
                sums[k] += batch_reflection(surfaces[k], first);
            }
        }
        barrier();
    }
    for (int k = 0; k < PIXELS; ++k) {
        if (glossy[k]) {
            ivec2 pixel = pixel_at(tile, k);
            imageStore(reflected, pixel, vec4(imageLoad(reflected, pixel).rgb + sums[k], 0.0));
        }
    }
}
