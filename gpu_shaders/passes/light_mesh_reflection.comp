// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that each pixel's specular layer sends to the eye of a run of virtual lights, added to that of earlier runs.
// A work group shades a tile of pixels and leaves out the lights that give nothing to any of them.
#include "gpu_layout/VirtualLight"
#define TILE_ACCESS readonly
#include "passes/tile_pixels.glsl"
#include "passes/reflectance.glsl"
#include "lib/ltc.glsl"

// Of lights that are sorted at once: what a lobe is made of is found again for each batch.
#define BATCH (4 * GROUP_SIZE)
#define WORDS (BATCH / 32)
// Lights that a point or a few stand for at every pixel of the tile; others, wholly above all of its horizons, or not.
#define ONE_POINT 0
#define FEW_POINTS 1
#define WHOLE 2
#define CLIPPED 3
#define CLASSES 4
#define NOTHING -1
// What drivers' arc functions may be off by, radians.
#define ARC_SLACK 2e-3

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused
layout(rgba32f, binding = 0) uniform image2D reflected; // W/(m² sr), w 0
layout(binding = LTC_TABLE_UNIT) uniform sampler2D ltc_table;

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform uint first_light;
uniform uint end_light;

// One bit for each light of a batch, by class.
shared uint members[CLASSES * WORDS];
// Cone that holds the lobes of all glossy pixels as far as they reach, and most_stretch of them all.
shared vec3 mirror_sums[GROUP_SIZE];
shared vec2 bounds[GROUP_SIZE];
vec3 cone_axis;
float cone_angle;   // radians; below 0 where no pixel is glossy
float stretch;

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

#define ADD_MEMBERS(CLASS, SEEN) \
    for (int word = 0; word < WORDS; ++word) { \
        uint bits = members[CLASS * WORDS + word]; \
        while (bits != 0u) { \
            uint i = first + uint(32 * word + findLSB(bits)); \
            bits &= bits - 1u; \
            VirtualLight light = lights[i]; \
            vec3 a = light.v0 - position, b = light.v1 - position, c = light.v2 - position; \
            vec3 centre = (a + b + c) * (1.0 / 3.0); \
            bool is_left_out = LEAVES_OUT(light.tag_id, surface.tag_id); \
            vec3 radiance = is_left_out ? vec3(0.0) : radiosities[i].rgb * INVERSE_PI; \
            sum += radiance * (SEEN); \
        } \
    }

LtcLobe lobe_of(Surface surface, Reflector reflector) {
    vec3 to_view = to_camera(surface.position);
    float cos_view = dot(surface.shading_normal, to_view);
    // Of the channel without Fresnel, in which F0 does not matter.
    float albedo = lookup_albedo(albedo_table, 0.0, cos_view, sqrt(reflector.alpha)).y;
    vec4 fit = lookup_ltc(ltc_table, reflector.alpha, cos_view);
    return make_ltc_lobe(fit, reflector.alpha, albedo, surface.shading_normal, to_view);
}

vec3 batch_reflection(Surface surface, uint first) {
    vec3 position = surface.position, normal = surface.shading_normal, to_view = to_camera(position);
    Reflector reflector = make_reflector(surface, to_view, albedo_table);
    LtcLobe lobe = lobe_of(surface, reflector);
    vec3 sum = vec3(0.0);
    ADD_MEMBERS(ONE_POINT, point_reflection(reflector, normal, to_view, centre, light.area_vector))
    ADD_MEMBERS(FEW_POINTS, points_reflection(reflector, normal, to_view, a, b, c, light.area_vector))
    ADD_MEMBERS(WHOLE, mix(
        lobe_reflection(lobe, reflector, normal, to_view,
            triangle_lobe_share(lobe, a, b, c, light.area_vector, -dot(light.area_vector, a))),
        points_reflection(reflector, normal, to_view, a, b, c, light.area_vector),
        point_share(size_in_lobe(lobe, centre, light.bounding_radius))))
    ADD_MEMBERS(CLIPPED, mix(
        lobe_reflection(lobe, reflector, normal, to_view,
            clipped_lobe_share(lobe, normal, a, b, c, light.area_vector)),
        points_reflection(reflector, normal, to_view, a, b, c, light.area_vector),
        point_share(size_in_lobe(lobe, centre, light.bounding_radius))))
    return sum;
}

// What bounds the lobes of all glossy pixels.
void bound_lobes() {
    uint index = gl_LocalInvocationIndex;
    vec3 mirrors[PIXELS];
    mirror_sums[index] = vec3(0.0);
    for (int k = 0; k < PIXELS; ++k) {
        mirrors[k] = reflect(-to_camera(surfaces[k].position), surfaces[k].shading_normal);
        mirror_sums[index] += glossy[k] ? mirrors[k] : vec3(0.0);
    }
    barrier();
    vec3 sum = vec3(0.0);
    for (int i = 0; i < GROUP_SIZE; ++i) {
        sum += mirror_sums[i];
    }
    cone_axis = sum * inversesqrt(max(dot(sum, sum), 1e-30));
    bounds[index] = vec2(-1.0, 0.0);
    for (int k = 0; k < PIXELS; ++k) {
        if (glossy[k]) {
            vec3 to_view = to_camera(surfaces[k].position);
            Reflector reflector = make_reflector(surfaces[k], to_view, albedo_table);
            float away = acos(clamp(dot(cone_axis, mirrors[k]), -1.0, 1.0));
            float reach = lobe_reach(reflector.alpha, dot(to_view, surfaces[k].shading_normal));
            bounds[index] = max(bounds[index], vec2(away + reach, most_stretch(lobe_of(surfaces[k], reflector))));
        }
    }
    barrier();
    vec2 most = vec2(-1.0, 0.0);
    for (int i = 0; i < GROUP_SIZE; ++i) {
        most = max(most, bounds[i]);
    }
    cone_angle = most.x;
    stretch = most.y;
}

// The class of a light that holds for all of the tile.
int reflected_class(PointGroup group, VirtualLight light) {
    int from_surface = light_class(group, light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius);
    vec3 to_light = (light.v0 + light.v1 + light.v2) * (1.0 / 3.0) - group.centre;
    float middle = length(to_light), tile_radius = length(group.half_extent);
    float radius = light.bounding_radius + tile_radius;
    if (from_surface == LIGHT_GIVES_NOTHING) {
        return NOTHING;
    }
    if (middle > radius) {
        float away = acos(clamp(dot(to_light, cone_axis) / middle, -1.0, 1.0));
        if (away - asin(radius / middle) > cone_angle + ARC_SLACK) {
            return NOTHING;
        }
        float nearest = middle - tile_radius;
        float size = stretch * light.bounding_radius * light.bounding_radius / (nearest * nearest);
        if (size < LTC_POINT_SIZES.x) {
            return size < LTC_ONE_POINT_SIZE ? ONE_POINT : FEW_POINTS;
        }
    }
    return from_surface == LIGHT_IS_CLIPPED ? CLIPPED : WHOLE;
}

// Sorts the BATCH lights from `first` on into `members`.
void classify(PointGroup group, uint first, uint end) {
    for (uint i = gl_LocalInvocationIndex; i < uint(CLASSES * WORDS); i += GROUP_SIZE) {
        members[i] = 0u;
    }
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < BATCH && first + i < end; i += GROUP_SIZE) {
        if (any(greaterThan(radiosities[first + i].rgb, vec3(0.0)))) {
            int class_of_light = reflected_class(group, lights[first + i]);
            if (class_of_light != NOTHING) {
                atomicOr(members[uint(class_of_light) * WORDS + i / 32u], 1u << (i % 32u));
            }
        }
    }
    barrier();
}

void main() {
    uint tile = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    PointGroup group = tiles[tile];
    if (group.half_extent.x < 0.0) {
        return;
    }
    fetch_pixels(tile);
    for (int k = 0; k < PIXELS; ++k) {
        sums[k] = vec3(0.0);
        surfaces[k] = fetch_surface(min(pixel_at(tile, k), picture_size - 1));
        glossy[k] = shown[k] && is_glossy_to_eye(surfaces[k]);
    }
    bound_lobes();
    if (cone_angle < 0.0) {
        return;
    }
    for (uint first = first_light; first < end_light; first += BATCH) {
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
