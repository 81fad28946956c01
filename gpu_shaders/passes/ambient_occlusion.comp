// SPDX-License-Identifier: GPL-3.0-or-later
// What one view of the scene tells of the surroundings of every pixel's surface (seed 003, 4.2.3 and 4.3.2). The kernel is
// points along directions as dense as the cosine; a direction is closed where one of its points lies behind what the view
// shows there, by no more than what shows may be thick: the range check. TELLS_POINTS writes what is known of each point,
// for passes/ambient_occlusion_join.comp; else the open directions and all are counted, by the weight of the view where
// it WEIGHS.
//
// What shows in a texel is taken for a piece of its triangle's plane. So a plane does not hide its own neighbourhood,
// however it is seen and however coarse the texels are, and no bias has to make up for that.
#include "passes/gbuffer_samplers.glsl"
#include "passes/ambient_occlusion_points.glsl"
#include "lib/directions.glsl"
#include "lib/shadow.glsl"
#include "lib/spread_pattern.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

// In front of a plane, or behind it by less than this share of the way from the receiver: rounding.
#define LEAST_BEHIND 1e-3
// Of the radius: by so much a receiver is lifted to ask whether a view takes it to be inside something.
#define LIFT 0.01
// A view sees a receiver that is within so many texels of what it shows there, and of its plane.
#define SEEN_WITHIN 2.0
#define SEEN_ON_PLANE 0.5
#define SEEN_COSINE 0.5
// A view's word always weighs something where it sees the receiver at all.
#define LEAST_WEIGHT 1e-4

layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(binding = VIEW_POSITION_UNIT) uniform sampler2D view_position;   // w: depth; all in the view's space
layout(binding = VIEW_NORMAL_UNIT) uniform sampler2D view_normal;       // geometric; 0 where nothing shows
#if TELLS_POINTS
layout(rgba32ui, binding = 0) uniform uimage2D told_points;
#else
layout(rg32f, binding = 0) uniform image2D sums;    // open directions, and all; by weight
#endif

uniform float scale;        // with the offset takes a pixel's place into the space of the view
uniform vec3 offset;
uniform mat4 clip_from_view_space;          // of the camera
uniform vec3 eye;           // of the view; where its rays are parallel, unit, against them
uniform bool is_parallel;
uniform float texel_at_0, texel_per_depth;  // of the view, m: texel_at_0 + texel_per_depth x depth
uniform float radius;       // m, in the view's space as the rest
uniform float thickness;    // m, of what shows
uniform int first_direction, end_direction; // of this run
uniform int directions, steps;
uniform float distance_share;   // of the distance weight in the whole
uniform uint sample_index;

#if VIEW_IS_MAP
// Where x is in the view, in [0, 1]² of its tile, and the tile; false where it is beside it.
bool find_place(vec3 x, out vec2 place, out vec2 tile) {
    Lamp lamp = lamps[0];
    ShadowPoint seen = shadow_point(lamp, x, vec3(0.0));
    float depth = lamp.shadow_kind == SHADOW_PARALLEL ? 1.0 : seen.position.z;
    bool is_before = depth > 0.0;
    vec2 plane = seen.position.xy / (is_before ? depth : 1.0);
    place = (plane - lamp.shadow_centre) / lamp.shadow_extent * 0.5 + 0.5;
    tile = seen.tile;
    return is_before;
}

vec2 tile_count() {
    return lamps[0].shadow_kind == SHADOW_CUBE ? vec2(SHADOW_CUBE_COLUMNS, SHADOW_CUBE_ROWS) : vec2(1.0);
}
#else
bool find_place(vec3 x, out vec2 place, out vec2 tile) {
    vec4 clip = clip_from_view_space * vec4(x, 1.0);
    bool is_before = clip.w > 0.0;
    place = clip.xy / (is_before ? clip.w : 1.0) * 0.5 + 0.5;
    tile = vec2(0.0);
    return is_before;
}

vec2 tile_count() {
    return vec2(1.0);
}
#endif

// The view's texel that shows what lies on the way to x; false where x is not in the view.
bool find_texel(vec3 x, out ivec2 texel) {
    vec2 place, tile;
    bool is_inside = find_place(x, place, tile);
    is_inside = is_inside && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(1.0)));
    vec2 size = vec2(textureSize(view_position, 0)) / tile_count();
    vec2 within = is_inside ? min(floor(place * size), size - 1.0) : vec2(0.0);
    texel = ivec2(tile * size + within);
    return is_inside;
}

float texel_width(float depth) {
    return texel_at_0 + texel_per_depth * depth;
}

// Whether the view shows the surface that p lies on. normal: unit. cosine: between it and the way to the view's eye.
bool is_seen(vec3 p, vec3 normal, float cosine) {
    ivec2 texel;
    if (cosine <= 0.0 || !find_texel(p, texel)) {
        return false;
    }
    vec4 shown = texelFetch(view_position, texel, 0);
    vec3 shown_normal = texelFetch(view_normal, texel, 0).xyz;
    vec3 way = p - shown.xyz;
    float width = texel_width(shown.w);
    return dot(normal, shown_normal) > SEEN_COSINE && abs(dot(way, shown_normal)) <= SEEN_ON_PLANE * width
        && length(way) * cosine <= SEEN_WITHIN * width;
}

// What the view tells of the point x, and how far from p it shows something there, m, `radius` at most. before: where
// the way to x comes from.
uint look(vec3 p, vec3 x, vec3 before, out float distance_to_p) {
    distance_to_p = radius;
    ivec2 texel;
    if (!find_texel(x, texel)) {
        return POINT_UNKNOWN;
    }
    vec3 normal = texelFetch(view_normal, texel, 0).xyz;
    if (!shows_geometry(normal)) {
#if VIEW_IS_MAP
        return POINT_UNKNOWN;   // so is a map where the lamp sees a clockwise side
#else
        return POINT_FREE;
#endif
    }
    vec4 shown = texelFetch(view_position, texel, 0);
    distance_to_p = min(distance(shown.xyz, p), radius);
    float least = LEAST_BEHIND * distance(x, p);
    if (dot(shown.xyz - x, normal) <= least) {
        return POINT_FREE;
    }
    float behind = distance(shown.xyz, x) - texel_width(shown.w), way = distance(before, x);
    if (behind <= way && dot(shown.xyz - before, normal) <= least) {
        return POINT_CLOSED;
    }
    return behind <= thickness + way ? POINT_ASSUMED : POINT_UNKNOWN;
}

// A direction of the kernel of a pixel, and in (0, 1] how far the first of its points is from the surface.
vec4 kernel_direction(ivec2 pixel, int index, vec3 normal) {
    vec2 random = spread_pattern(uvec2(pixel), uint(index), sample_index);
    vec3 direction = cosine_direction(normal, vec2((float(index) + random.x) / float(directions), random.y));
    return vec4(direction, 1.0 - spread_random(uvec2(pixel), uint(index), sample_index));
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(gbuffer_position, 0))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    vec3 p = scale * texelFetch(gbuffer_position, pixel, 0).xyz + offset;
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 geometric_normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
#if TELLS_POINTS && VIEW_IS_MAP
    uvec4 told = imageLoad(told_points, pixel);
#else
    uvec4 told = uvec4(0u);
#endif
    vec3 to_eye = is_parallel ? eye : eye - p;
    to_eye *= inversesqrt(max(dot(to_eye, to_eye), 1e-30));
    bool trusts_thickness = true;
#if VIEW_IS_MAP
    bool sees_receiver = is_seen(p, geometric_normal, dot(geometric_normal, to_eye));
#if TELLS_POINTS
    // Over its surface nothing is: a view that takes the receiver to be inside of something takes that for too thick.
    float unused;
    vec3 lifted = p + LIFT * radius * geometric_normal;
    trusts_thickness = sees_receiver || !is_in_the_way(look(p, lifted, lifted, unused));
#else
    if (!sees_receiver) {
        return;
    }
#endif
#endif
    float open = 0.0, nearness = 0.0, looked = 0.0;
    for (int i = first_direction; i < end_direction; ++i) {
        vec4 direction = kernel_direction(pixel, i, normal);
        bool is_open = dot(direction.xyz, geometric_normal) > 0.0;
        if (!is_open) {
            tell(told, (i - first_direction) * steps, POINT_CLOSED);
        }
        vec3 before = p;
        for (int j = 0; j < steps && is_open; ++j) {
            // The last point is at the radius, so that nothing within it lies beyond all points.
            float part = (float(j) + direction.w) / (float(steps - 1) + direction.w);
            vec3 x = p + radius * part * part * direction.xyz;
            float distance_to_p;
            uint found = look(p, x, before, distance_to_p);
            found = found == POINT_ASSUMED && !trusts_thickness ? POINT_UNKNOWN : found;
            nearness += 1.0 - distance_to_p / radius;
            looked += 1.0;
            before = x;
            tell(told, (i - first_direction) * steps + j, found);
#if !TELLS_POINTS
            is_open = !is_in_the_way(found);
#endif
        }
        open += is_open ? 1.0 : 0.0;
    }
#if TELLS_POINTS
    imageStore(told_points, pixel, told);
#else
    float count = float(end_direction - first_direction);
#if WEIGHS
    float weight = mix(max(dot(normal, to_eye), 0.0), nearness / max(looked, 1.0), distance_share);
    // As a whole number: drivers may take any comparison with NaN for true.
    bool is_usable = (floatBitsToUint(weight) & 0x7fffffffu) <= floatBitsToUint(1.0);
    weight = is_usable ? max(weight, LEAST_WEIGHT) : LEAST_WEIGHT;
#else
    const float weight = 1.0;
#endif
    vec2 sum = imageLoad(sums, pixel).xy + weight * vec2(open, count);
    imageStore(sums, pixel, vec4(sum, 0.0, 0.0));
#endif
}
