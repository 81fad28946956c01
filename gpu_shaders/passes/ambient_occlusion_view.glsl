// SPDX-License-Identifier: GPL-3.0-or-later
// What one view of the scene, the camera's or a lamp's map, tells of points and of ways between them. All in its space.
//
// What shows in a texel is taken for a piece of its triangle's plane. So a plane does not hide its own neighbourhood,
// however it is seen and however coarse the texels are, and no bias has to make up for that.
#ifndef PASSES_AMBIENT_OCCLUSION_VIEW
#define PASSES_AMBIENT_OCCLUSION_VIEW
#include "lib/gbuffer.glsl"
#include "lib/shadow.glsl"
#include "passes/ambient_occlusion_points.glsl"

// Behind a plane by less than this share of the way from the receiver is before it: rounding.
#define LEAST_BEHIND 1e-3
// A view sees a point that is within so many texels of what it shows there, and of its plane.
#define SEEN_WITHIN 2.0
#define SEEN_ON_PLANE 0.5
#define SEEN_COSINE 0.5

layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(binding = VIEW_POSITION_UNIT) uniform sampler2D view_position;   // w: depth
layout(binding = VIEW_NORMAL_UNIT) uniform sampler2D view_normal;       // geometric; 0 where nothing shows

uniform mat4 clip_from_view_space;          // of the camera
uniform vec3 eye;                           // where the view's rays are parallel, unit, against them
uniform bool is_parallel;
uniform float texel_at_0, texel_per_depth;  // m: texel_at_0 + texel_per_depth x depth
uniform float thickness;                    // m, of what shows

// What is in the texel that shows what lies on the way to a point.
struct Shown {
    vec3 place;
    vec3 normal;        // unit; 0 where no surface shows
    float width;        // of the texel there, m
    bool is_in_view;    // whether the point is
};

#if VIEW_IS_MAP
vec2 tile_count() {
    return lamps[0].shadow_kind == SHADOW_CUBE ? vec2(SHADOW_CUBE_COLUMNS, SHADOW_CUBE_ROWS) : vec2(1.0);
}

// Where x is in the view, in [0, 1]² of its tile, and the tile; false where it is behind it.
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
#else
vec2 tile_count() {
    return vec2(1.0);
}

bool find_place(vec3 x, out vec2 place, out vec2 tile) {
    vec4 clip = clip_from_view_space * vec4(x, 1.0);
    bool is_before = clip.w > 0.0;
    place = clip.xy / (is_before ? clip.w : 1.0) * 0.5 + 0.5;
    tile = vec2(0.0);
    return is_before;
}
#endif

Shown shown_at(vec3 x) {
    vec2 place, tile;
    bool is_inside = find_place(x, place, tile);
    is_inside = is_inside && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(1.0)));
    if (!is_inside) {
        return Shown(vec3(0.0), vec3(0.0), 0.0, false);
    }
    vec2 size = vec2(textureSize(view_position, 0)) / tile_count();
    ivec2 texel = ivec2(tile * size + min(floor(place * size), size - 1.0));
    vec4 position = texelFetch(view_position, texel, 0);
    return Shown(position.xyz, texelFetch(view_normal, texel, 0).xyz, texel_at_0 + texel_per_depth * position.w, true);
}

// Unit vector from p to the view's eye.
vec3 direction_to_eye(vec3 p) {
    vec3 way = is_parallel ? eye : eye - p;
    return way * inversesqrt(max(dot(way, way), 1e-30));
}

// Whether the view shows, on the side that the unit normal is on, the surface that p lies on.
bool is_seen(vec3 p, vec3 normal) {
    float cosine = dot(normal, direction_to_eye(p));
    Shown shown = shown_at(p);
    vec3 way = p - shown.place;
    return cosine > 0.0 && dot(normal, shown.normal) > SEEN_COSINE
        && abs(dot(way, shown.normal)) <= SEEN_ON_PLANE * shown.width && length(way) * cosine <= SEEN_WITHIN * shown.width;
}

float height_over(Shown shown, vec3 x) {
    return dot(x - shown.place, shown.normal);
}

// What the view tells of the point x, where it shows `shown`. before: where the way to x comes from. far: m, from the
// receiver to x.
uint look(Shown shown, vec3 x, vec3 before, float far) {
    if (!shows_geometry(shown.normal)) {
        // Nothing is before the background; but a map is empty, too, where its lamp sees a clockwise side.
        return shown.is_in_view && VIEW_IS_MAP == 0 ? POINT_FREE : POINT_UNKNOWN;
    }
    if (height_over(shown, x) >= -LEAST_BEHIND * far) {
        return POINT_FREE;
    }
    // Behind by no more than the way is long: that may have led through.
    float behind = distance(shown.place, x) - shown.width - distance(before, x);
    return behind <= thickness ? POINT_ASSUMED : POINT_UNKNOWN;
}

// Whether a way leads through the surface that is shown, and that there, so far from the receiver at p that the view's
// texels tell both apart.
bool leads_through(Shown shown, vec3 begin, vec3 end, vec3 p) {
    float least = LEAST_BEHIND * distance(end, p);
    float first = height_over(shown, begin), last = height_over(shown, end);
    bool changes_side = first >= -least && last < -least || first < -least && last >= -least;
    vec3 place = mix(begin, end, clamp(first / (first - last), 0.0, 1.0));
    float cosine = dot(shown.normal, direction_to_eye(place));
    return changes_side && shows_geometry(shown.normal) && distance(place, p) * cosine > SEEN_WITHIN * shown.width
        && is_seen(place, shown.normal);
}
#endif
