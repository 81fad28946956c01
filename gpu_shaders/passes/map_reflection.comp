// SPDX-License-Identifier: GPL-3.0-or-later
// What the ray of each pixel meets of what one lamp lights, whether or not the picture shows it (seed 003, 4.3.1): the ray
// is followed through the lamp's reflective shadow map. Of several maps the
// nearest hit counts, and what all lamps give it.
#include "passes/gbuffer_samplers.glsl"
#include "passes/sound_radiance.glsl"
#include "lib/rsm.glsl"
#include "lib/screen_ray.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(binding = MAP_POSITION_UNIT) uniform sampler2D map_position;
layout(binding = MAP_NORMAL_UNIT) uniform sampler2D map_normal;
layout(binding = MAP_FLUX_UNIT) uniform sampler2D map_flux;
layout(binding = MAP_GEOMETRIC_NORMAL_UNIT) uniform sampler2D map_geometric_normal;
#if HAS_KNOWN
layout(binding = KNOWN_UNIT) uniform sampler2D known;   // w: how sure it is already what the ray meets
#endif
layout(binding = RAYS_UNIT) uniform sampler2D rays;     // passes/reflection_rays.comp
layout(rgba32f, binding = 0) uniform image2D incoming;  // W/(m² sr) along the ray, times w: how sure it is, in [0, 1]
layout(rg32f, binding = 1) uniform image2D nearest;     // m along the ray to the hit, and how far off others may be

uniform float map_scale;        // with the offset takes a place into the space of the map; m below are of that space
uniform vec3 map_offset;
uniform int side;               // texels along a face
uniform float reach, thickness; // m
uniform int steps, halvings;

const bool is_cube = IS_CUBE != 0, is_parallel = IS_PARALLEL != 0;

// Of a texel's size: surfaces come no nearer than that within a texel.
#define STEEPEST 8.0
// Of a texel's size: how far beneath its plane what belongs to its surface may lie.
#define ON_SURFACE 0.1
// Texels' sizes on a ray's way behind something from which on it cannot be the surface that it starts on.
#define FAR_BEHIND 2.0
// Texels' sizes and share of the distance within which hits in two maps are one.
#define SAME_PLACE vec2(2.0, 1e-3)
#define REACH_FADE 0.1

struct MapHit {
    float distance;     // m along the ray
    float confidence;   // in [0, 1]; 0 for no hit
    ivec2 texel;
};

// A ray in a face of the map.
struct FaceRay {
    vec3 origin;        // m, in the space of the map
    vec3 direction;     // unit
    vec3 forward;       // unit, away from the lamp: the axis of depth
    ivec2 tile;         // first texel of the face
    float texel;        // m, size of a texel at depth 1, of a sun's map at any depth
    float starts;       // m along the ray to where it comes into the face
    ScreenRay line;     // from there on, in texels of the face
};

// Where a ray is in the map against what the lamp sees there.
struct Sample {
    ivec2 texel;
    bool is_behind;
    float height;       // m over the texel's plane
    float towards;      // cosine at which the ray goes into that plane
    float gap;          // m behind it along the face's axis
    float size;         // m, of the texel
};

// q: in the lamp's frame. Along the two axes of a face and away from the lamp, as shadow_point.
vec3 in_face(vec3 q, int face) {
#if IS_CUBE
    int axis = face / 2;
    q = axis == 0 ? q.yzx : axis == 1 ? q.zxy : q;
    return (face & 1) == 1 ? q * vec3(1.0, 1.0, -1.0) : q;
#elif IS_PARALLEL
    return q;
#else
    return q * vec3(1.0, 1.0, -1.0);
#endif
}

// The axis of a face's depth, in the lamp's frame.
vec3 away_from_lamp(int face) {
#if IS_CUBE
    vec3 axis = vec3(equal(ivec3(face / 2), ivec3(0, 1, 2)));
    return (face & 1) == 1 ? -axis : axis;
#else
    return vec3(0.0, 0.0, -1.0);
#endif
}

// First texel of a face in the map.
ivec2 face_tile(int face) {
    return is_cube ? ivec2(face % SHADOW_CUBE_COLUMNS, face / SHADOW_CUBE_COLUMNS) * side : ivec2(0);
}

// Leaves of an interval the part in which value + rate * t is not negative.
void confine(float value, float rate, inout vec2 interval) {
    if (rate > 0.0) {
        interval.x = max(interval.x, -value / rate);
    } else if (rate < 0.0) {
        interval.y = min(interval.y, -value / rate);
    } else if (value < 0.0) {
        interval.y = -1.0;
    }
}

// The part of a ray in a face. q, d: its origin and direction in the face's frame. starts: m along the ray.
ScreenRay face_ray(Lamp lamp, vec3 q, vec3 d, out float starts) {
    vec2 interval = vec2(0.0, reach);
#if IS_PARALLEL
    vec2 width = vec2(1.0, 0.0);
#else
    vec2 width = vec2(q.z, d.z);
    confine(q.z - 1e-6 * reach, d.z, interval);
#endif
    for (int axis = 0; axis < 2; ++axis) {
        vec2 along = vec2(q[axis], d[axis]) - lamp.shadow_centre[axis] * width;
        confine(lamp.shadow_extent[axis] * width.x - along.x, lamp.shadow_extent[axis] * width.y - along.y, interval);
        confine(lamp.shadow_extent[axis] * width.x + along.x, lamp.shadow_extent[axis] * width.y + along.y, interval);
    }
    starts = interval.x;
    if (!(interval.y > interval.x)) {
        return ScreenRay(vec2(0.0), vec2(0.0), 0.0, 0.0, vec2(1.0));
    }
    vec3 first = q + interval.x * d, last = q + interval.y * d;
    vec2 scales = max(width.x + interval * width.y, 1e-30);
    vec2 texel_size = lamp.shadow_extent * (2.0 / float(side));
    vec2 start = (first.xy / scales.x - lamp.shadow_centre + lamp.shadow_extent) / texel_size;
    vec2 end = (last.xy / scales.y - lamp.shadow_centre + lamp.shadow_extent) / texel_size;
    return ScreenRay(start, end - start, 1.0, interval.y - interval.x, scales);
}

Sample sample_map(Lamp lamp, FaceRay ray, float share) {
    ivec2 texel = ray.tile + clamp(ivec2(floor(ray.line.start + share * ray.line.span)), ivec2(0), ivec2(side - 1));
    Sample result = Sample(texel, false, 0.0, 0.0, 0.0, 0.0);
    vec4 position = texelFetch(map_position, texel, 0);
    vec3 beyond = ray.origin + (ray.starts + ray_distance(ray.line, share)) * ray.direction - position.xyz;
    float depth = dot(beyond, ray.forward);
    // Where the lamp sees nothing, or where the ray is nearer to it than what a texel shows may be.
    if (position.w == 0.0 || depth < -STEEPEST * (is_parallel ? ray.texel : ray.texel * position.w)) {
        return result;
    }
    vec3 normal = texelFetch(map_geometric_normal, texel, 0).xyz;
    result.size = sqrt(texelFetch(map_normal, texel, 0).w);
    result.height = dot(normal, beyond);
    result.towards = -dot(normal, ray.direction);
    result.gap = max(depth - result.size, 0.0);
    result.is_behind = result.height < -ON_SURFACE * result.size;
    return result;
}

// The first surface in a face that the ray meets. blocked: is set to where it comes out of something from behind.
MapHit follow_face(Lamp lamp, vec3 origin, vec3 direction, int face, inout float blocked) {
    const MapHit none = MapHit(0.0, 0.0, ivec2(0));
    mat3 axes = mat3(lamp.x_axis, lamp.y_axis, lamp.z_axis);
    vec3 q = in_face((origin - lamp.shadow_origin) * axes, face), d = in_face(direction * axes, face);
    FaceRay ray = FaceRay(origin, direction, axes * away_from_lamp(face), face_tile(face), 0.0, 0.0, ScreenRay(
        vec2(0.0), vec2(0.0), 0.0, 0.0, vec2(1.0)
    ));
    ray.texel = max(lamp.shadow_extent.x, lamp.shadow_extent.y) * (2.0 / float(side));
    ray.line = face_ray(lamp, q, d, ray.starts);
    if (ray.line.end <= 0.0) {
        return none;
    }
    int count = clamp(int(ceil(max(abs(ray.line.span.x), abs(ray.line.span.y)))), 1, steps);
    Sample before = sample_map(lamp, ray, 0.0);
    float way = before.is_behind ? 1e-20 : 0.0, gap = before.gap, sure = 1.0;
    for (int i = 1; i <= count; ++i) {
        float low = float(i - 1) / float(count), high = float(i) / float(count);
        Sample after = sample_map(lamp, ray, high);
        if (after.is_behind != before.is_behind) {
            Sample at_low = before, at_high = after;
            for (int halving = 0; halving < halvings; ++halving) {
                float middle = 0.5 * (low + high);
                Sample at_middle = sample_map(lamp, ray, middle);
                if (at_middle.is_behind == at_high.is_behind) {
                    high = middle;
                    at_high = at_middle;
                } else {
                    low = middle;
                    at_low = at_middle;
                }
            }
            float enters = ray.starts + ray_distance(ray.line, low), leaves = ray.starts + ray_distance(ray.line, high);
            if (at_high.is_behind && at_high.towards > 0.0) {
                float past = -at_high.height / at_high.towards;
                if (past <= leaves - enters + at_high.size) {
                    return MapHit(clamp(leaves - past, enters, leaves), sure, at_high.texel);
                }
                if (at_high.gap < thickness) {
                    return MapHit(leaves, sure * (1.0 - at_high.gap / thickness), at_high.texel);
                }
            }
            if (at_low.is_behind) {
                float rises = -at_low.towards * (leaves - enters) + ON_SURFACE * at_low.size;
                if (way > FAR_BEHIND * at_low.size && at_low.towards < 0.0 && -at_low.height <= rises) {
                    blocked = min(blocked, enters);
                    return none;
                }
                sure = min(sure, passed_share(gap, way));
                way = 0.0;
            }
        }
        if (after.is_behind) {
            gap = way > 0.0 ? min(gap, after.gap) : after.gap;
            way += length(ray.line.span) / float(count) * after.size;
        }
        before = after;
    }
    return none;
}

MapHit follow(Lamp lamp, vec3 origin, vec3 direction) {
    MapHit best = MapHit(reach, 0.0, ivec2(0));
    float blocked = reach;
    for (int face = 0; face < (is_cube ? 6 : 1); ++face) {
        MapHit hit = follow_face(lamp, origin, direction, face, blocked);
        if (hit.confidence > 0.0 && hit.distance < best.distance) {
            best = hit;
        }
    }
    best.confidence *= best.distance <= blocked ? clamp((reach - best.distance) / (REACH_FADE * reach), 0.0, 1.0) : 0.0;
    return best;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(incoming)))) {
        return;
    }
    vec4 ray = texelFetch(rays, pixel, 0);
    float share = 1.0;
#if HAS_KNOWN
    share -= clamp(texelFetch(known, pixel, 0).w, 0.0, 1.0);
#endif
    if (!(ray.w > 0.0) || !(share > 0.0)) {
        return;
    }
    vec3 origin = map_scale * texelFetch(gbuffer_position, pixel, 0).xyz + map_offset;
    MapHit hit = follow(lamps[0], origin, ray.xyz);
    float confidence = share * hit.confidence;
    if (!(confidence > 0.0) || !all(are_sound(vec4(confidence, hit.distance, 0.0, 0.0)))) {
        return;
    }
    float area = texelFetch(map_normal, hit.texel, 0).w;
    vec3 radiance = texelFetch(map_flux, hit.texel, 0).rgb / (FORM_FACTOR_PI * area);
    vec4 found = vec4(confidence * sound_radiance(radiance), confidence);
    float distance = hit.distance / map_scale;
    float tolerance = SAME_PLACE.x * sqrt(area) / map_scale + SAME_PLACE.y * distance;
    vec4 before = imageLoad(incoming, pixel);
    vec2 other = imageLoad(nearest, pixel).rg;
    if (before.w > 0.0 && distance > other.x + max(other.y, tolerance)) {
        return;
    }
    bool is_same = before.w > 0.0 && distance >= other.x - max(other.y, tolerance);
    imageStore(incoming, pixel, is_same ? vec4(before.rgb + found.rgb, max(before.w, found.w)) : found);
    imageStore(nearest, pixel, is_same ? vec4(min(other.x, distance), max(other.y, tolerance), 0.0, 0.0)
        : vec4(distance, tolerance, 0.0, 0.0));
}
