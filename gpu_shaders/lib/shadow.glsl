// SPDX-License-Identifier: GPL-3.0-or-later
// Share of a lamp's sample point that a surface point sees, from a map of nearness.
//
// The map holds near / distance along the face's axis, or the height along a sun's direction in m: larger is nearer,
// SHADOW_EMPTY is nothing. Both are linear over the map for a plane, so the receiver's own plane is known at each texel:
// it cannot shadow itself, and no offset is needed but what float32 rounds.
#ifndef LIB_SHADOW
#define LIB_SHADOW
#include "gpu_layout/Lamp"

// Depths in texels. Behind the receiver's plane by more than the first: the map looks past an edge of the receiver
// there and knows nothing of it. Before the plane, but not before the receiver itself by more than the second: perhaps
// a wall that rises next to it.
#define SHADOW_BEYOND 0.05
#define SHADOW_POINT_SLACK 0.5
// What float32 leaves between a plane and its own depths in the map.
#define SHADOW_ON_PLANE 5e-3

// Square of a cosine from which on light of the world is given no more slack: what grazes brings little, but from all
// around it would add up behind walls.
#define SHADOW_LEAST_OF_WORLD 1e-2

struct ShadowPoint {
    vec3 position;  // along a face's two axes and away from the lamp; for SHADOW_PARALLEL up towards the sun
    vec3 normal;    // likewise
    vec2 tile;      // of the face in the map
};

// Position and normal in the frame of the face that sees the point. offset: m, from the map's origin.
ShadowPoint shadow_place(Lamp lamp, vec3 offset, vec3 n) {
    mat3 axes = mat3(lamp.x_axis, lamp.y_axis, lamp.z_axis);
    vec3 m = n * axes;
    vec3 q = offset * axes;
    if (lamp.shadow_kind == SHADOW_PARALLEL) {
        return ShadowPoint(q, m, vec2(0.0));
    }
    const vec3 flip = vec3(1.0, 1.0, -1.0);
    if (lamp.shadow_kind == SHADOW_CONE) {
        return ShadowPoint(q * flip, m * flip, vec2(0.0));
    }
    vec3 size = abs(q);
    int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    q = axis == 0 ? q.yzx : axis == 1 ? q.zxy : q;
    m = axis == 0 ? m.yzx : axis == 1 ? m.zxy : m;
    bool negative = q.z < 0.0;
    int face = 2 * axis + int(negative);
    vec2 tile = vec2(float(face % SHADOW_CUBE_COLUMNS), float(face / SHADOW_CUBE_COLUMNS));
    return ShadowPoint(negative ? q * flip : q, negative ? m * flip : m, tile);
}

// The same of a point p from the local origin, for a map in units of the same space.
ShadowPoint shadow_point(Lamp lamp, vec3 p, vec3 n) {
    return shadow_place(lamp, p - lamp.shadow_origin, n);
}

// Share in [0, 1] of a texel's area around p in which nothing stands before the receiver's plane.
// p: m from the local origin; n: unit geometric normal on the lit side. map: of `lamp`, in texels without filter.
// tilt: how far the surface around p may lean away from n within a texel, radians.
float lit_share(sampler2D map, Lamp lamp, vec3 p, vec3 n, float tilt) {
    if (lamp.shadow_kind == SHADOW_NONE) {
        return 1.0;
    }
    bool parallel = lamp.shadow_kind == SHADOW_PARALLEL;
    vec3 to_lamp = lamp.kind == LAMP_SUN ? lamp.sample_position : lamp.sample_position - p;
    float cos_lamp = dot(n, to_lamp) * inversesqrt(max(dot(to_lamp, to_lamp), 1e-30));
    if (cos_lamp <= 0.0) {
        return 0.0;
    }
    // Depth grows with the tangent of the angle of incidence, its change with the square of one over the cosine.
    float least = lamp.world_solid_angle > 0.0 ? SHADOW_LEAST_OF_WORLD : 1e-4;
    float steepness = 1.0 / max(cos_lamp * cos_lamp, least);
    // In the order that loses nothing near the origin.
    vec3 offset = lamp.shadow_scale * ((p - lamp.shadow_origin) - lamp.shadow_origin_rest);
    ShadowPoint receiver = shadow_place(lamp, offset, n);
    if (!parallel && receiver.position.z <= 0.0) {
        return 0.0; // at the lamp, or behind a spot
    }
    vec2 tiles = lamp.shadow_kind == SHADOW_CUBE ? vec2(SHADOW_CUBE_COLUMNS, SHADOW_CUBE_ROWS) : vec2(1.0);
    vec2 map_size = vec2(textureSize(map, 0));
    vec2 resolution = map_size / tiles;
    vec2 texel = 2.0 * lamp.shadow_extent / resolution;

    vec2 uv;
    vec2 gradient;      // of the plane's nearness, per unit of uv
    float nearness;
    float slack;        // nearness per texel of depth
    float rounding;     // texels
    vec3 q = receiver.position;
    if (parallel) {
        uv = q.xy - lamp.shadow_centre;
        nearness = q.z;
        gradient = -receiver.normal.xy / max(receiver.normal.z, 1e-6);
        slack = max(texel.x, texel.y);
        rounding = lamp.shadow_rounding / slack;
    } else {
        uv = q.xy / q.z;
        nearness = lamp.shadow_near / q.z;
        gradient = lamp.shadow_near * receiver.normal.xy / min(dot(receiver.normal, q), -1e-6 * q.z);
        slack = max(texel.x, texel.y) * nearness;
        rounding = lamp.shadow_rounding / (max(texel.x, texel.y) * q.z);
    }
    rounding *= steepness;
    float leaning = max(tilt, SHADOW_ON_PLANE) * steepness + rounding;
    vec2 place = (uv / lamp.shadow_extent * 0.5 + 0.5) * resolution;
    vec2 corner = clamp(floor(place - 0.5), vec2(0.0), resolution - 2.0);
    vec2 fraction = clamp(place - 0.5 - corner, 0.0, 1.0);
    // Order of a gather: (0, 1), (1, 1), (1, 0), (0, 0).
    vec4 stored = textureGather(map, (receiver.tile * resolution + corner + 1.0) / map_size);
    vec2 to_corner = (corner + 0.5 - place) * texel;
    vec2 step_u = gradient * texel;
    float at_corner = nearness + dot(gradient, to_corner);
    vec4 plane = at_corner + vec4(step_u.y, step_u.x + step_u.y, step_u.x, 0.0);
    vec4 weights = vec4(1.0 - fraction.x, fraction.x, fraction.x, 1.0 - fraction.x)
        * vec4(fraction.y, fraction.y, 1.0 - fraction.y, 1.0 - fraction.y);
    vec4 depth = (stored - plane) / slack;
    vec4 clearly = vec4(greaterThan(stored, vec4(nearness + SHADOW_POINT_SLACK * slack)));
    vec4 before = vec4(greaterThan(depth, vec4(leaning)));
    float blocked = dot(weights, before * clearly);
    // Where an occluder meets the receiver it is for a moment just before it; only what lies on the plane itself then
    // tells of the receiver.
    float nearest = blocked > 0.0 ? SHADOW_ON_PLANE * steepness + rounding : leaning;
    vec4 on_it = vec4(lessThanEqual(depth, vec4(nearest))) * vec4(greaterThanEqual(depth, vec4(-SHADOW_BEYOND - leaning)));
    float seen = dot(weights, on_it);
    if (seen > 0.0) {
        return seen / (seen + blocked);
    }
    // Nothing of the receiver shows here: it is hidden, or too thin for the map.
    return dot(weights, before) > 0.0 ? 0.0 : 1.0;
}
#endif
