// SPDX-License-Identifier: GPL-3.0-or-later
// What the ray of each pixel meets of what the picture shows (seed 003, 4.2.4). The ray is followed through squares of pixels: larger ones while it is before all that they show, halved down to a pixel where
// it may not be.
#include "passes/gbuffer_samplers.glsl"
#include "passes/sound_radiance.glsl"
#include "lib/screen_ray.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = LIT_UNIT) uniform sampler2D lit;               // W/(m² sr) that each pixel sends to the eye
layout(binding = PYRAMID_UNIT) uniform sampler2D pyramid;       // passes/depth_pyramid.comp
layout(binding = RAYS_UNIT) uniform sampler2D rays;             // passes/reflection_rays.comp
layout(rgba32f, binding = 0) writeonly uniform image2D incoming; // W/(m² sr) along the ray, times w: how sure it is
layout(rgba32f, binding = 1) writeonly uniform image2D hits;    // place in pixels, distance in m, and w as above

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform mat4 clip_from_local;
uniform float nearest;      // homogeneous coordinate before which nothing shows
uniform vec2 pixel_size;    // m: at depth 0, and for each m of depth
uniform float reach;        // m
uniform float thickness;    // m
uniform float edge_fade;    // share of the picture's width and height
uniform int steps;          // squares that a ray visits at most
uniform int coarsest;       // level of the pyramid

// Of the pixel's plane, in its own sizes; steeper surfaces are no deeper within a pixel.
#define STEEPEST 8.0
// What of a pixel's size a ray may be beneath a plane by rounding.
#define ON_PLANE 1e-3
// Share of the reach over which hits fade at its end.
#define REACH_FADE 0.1

struct Ray {
    vec3 origin;        // m, from the local origin
    vec3 direction;     // unit
};

// How a ray goes through a pixel.
#define BEFORE 0    // all before its surface
#define MET 1       // meets it
#define BEHIND 2    // behind it, deeper than things are
#define OUT 3       // comes out of it from behind, which light does not

struct Passage {
    int kind;
    float distance;     // m along the ray: where it has met something
    float confidence;   // in [0, 1]: of that
    float gap;          // m: how far behind it is
    ivec2 pixel;        // whose surface it has met
};

struct Hit {
    vec2 place;         // pixels
    ivec2 pixel;        // that shows it
    float distance;     // m along the ray
    float confidence;   // in [0, 1]; 0 for no hit
};

// How far from a pixel's depth that of a neighbour of the same surface may be, m.
float depth_step(ivec2 pixel) {
    vec4 position = texelFetch(gbuffer_position, pixel, 0);
    vec3 to_eye = is_orthographic ? camera_backward : normalize(camera_position - position.xyz);
    float cosine = clamp(dot(texelFetch(gbuffer_geometric_normal, pixel, 0).xyz, to_eye), 1e-3, 1.0);
    float slope = sqrt(1.0 - cosine * cosine) / cosine;
    return (pixel_size.x + pixel_size.y * position.w) * (1.0 + min(slope, STEEPEST));
}

// Where the ray comes to the front of the plane of what a pixel shows, m; below 0 for nowhere.
float meeting(ivec2 pixel, Ray ray) {
    vec3 normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    float towards = -dot(normal, ray.direction);
    float height = dot(normal, ray.origin - texelFetch(gbuffer_position, pixel, 0).xyz);
    return towards > 0.0 ? height / towards : -1.0;
}

// enters, leaves: m along the ray; depth: at which it enters, m. before: the pixel that it comes from. comes_in: whether
// it was not behind that one.
Passage pass_pixel(
    ivec2 pixel, Ray ray, float depth, float enters, float leaves, ivec2 before, bool comes_in
) {
    vec4 position = texelFetch(gbuffer_position, pixel, 0);
    vec3 normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    float size = pixel_size.x + pixel_size.y * position.w;
    float towards = -dot(normal, ray.direction);
    float height = dot(normal, ray.origin - position.xyz);
    float depth_left = depth - (leaves - enters) * dot(ray.direction, camera_backward);
    // A plane that is seen edge on goes on within the pixel, but what shows of it need not.
    float slack = depth_step(pixel);
    if (max(depth, depth_left) < position.w - slack) {
        return Passage(BEFORE, 0.0, 0.0, 0.0, pixel);
    }
    bool is_deep = min(depth, depth_left) > position.w + slack;
    bool is_before = height - enters * towards >= -ON_PLANE * size;
    if (is_before && !is_deep) {
        bool meets = towards > 0.0 && height <= leaves * towards;
        return Passage(meets ? MET : BEFORE, meets ? max(height / towards, 0.0) : 0.0, 1.0, 0.0, pixel);
    }
    // It comes in behind: past an edge between two pixels of one thing, or from the side into something.
    float gap = max(depth - position.w, 0.0);
    if (comes_in && abs(texelFetch(gbuffer_position, before, 0).w - position.w) <= slack) {
        gap = max(gap - slack, 0.0);
        float goes_on = meeting(before, ray);
        if (goes_on >= 0.0 && goes_on <= leaves) {
            return Passage(MET, goes_on, 1.0, 0.0, before);
        }
    }
    if (!is_deep && !comes_in && height - leaves * towards > ON_PLANE * size) {
        return Passage(OUT, 0.0, 0.0, 0.0, pixel);
    }
    bool meets = comes_in && towards > 0.0 && gap <= thickness;
    float confidence = gap > 0.0 ? 1.0 - gap / max(thickness, 1e-20) : 1.0;
    if (meets && confidence > 0.0) {
        return Passage(MET, enters, confidence, 0.0, pixel);
    }
    bool is_nearer = comes_in && max(depth, depth_left) <= position.w;
    return Passage(is_nearer ? BEFORE : BEHIND, 0.0, 0.0, gap, pixel);
}

Hit follow(Ray ray, ivec2 pixel) {
    const Hit none = Hit(vec2(0.0), ivec2(0), 0.0, 0.0);
    vec2 size = vec2(textureSize(gbuffer_position, 0));
    ScreenRay line = make_screen_ray(clip_from_local, size, ray.origin, ray.direction, reach, nearest);
    float length_in_pixels = length(line.span);
    if (line.end <= 0.0 || length_in_pixels < 1e-3) {
        return none;
    }
    float start_depth = texelFetch(gbuffer_position, pixel, 0).w;
    float depth_rate = -dot(ray.direction, camera_backward);
    ivec2 square;
    float share = square_end(line, 0.0, 0, square);
    float enters = ray_distance(line, share);
    float sure = 1.0, gap = 0.0, way = 0.0;
    int level = 0;
    for (int i = 0; i < steps && share < line.end; ++i) {
        float end = square_end(line, share, level, square);
        float leaves = ray_distance(line, end);
        float farthest = start_depth + max(enters * depth_rate, leaves * depth_rate);
        bool is_free = farthest < texelFetch(pyramid, square, level).r;
        if (!is_free && level > 0) {
            --level;
            continue;
        }
        Passage passage = Passage(BEFORE, 0.0, 0.0, 0.0, square);
        if (is_free) {
            level = min(level + 1, coarsest);
        } else {
            float depth = start_depth + enters * depth_rate;
            passage = pass_pixel(square, ray, depth, enters, leaves, pixel_before(line, share), way == 0.0);
        }
        if (passage.kind == OUT) {
            return none;
        }
        if (passage.kind == BEHIND) {
            float across = pixel_size.x + pixel_size.y * texelFetch(gbuffer_position, square, 0).w;
            gap = way > 0.0 ? min(gap, passage.gap) : passage.gap;
            way += max((end - share) * length_in_pixels, 1e-3) * across;
        } else {
            sure = min(sure, passed_share(gap, way));
            way = 0.0;
        }
        if (passage.kind == MET) {
            vec4 clip = clip_from_local * vec4(ray.origin + passage.distance * ray.direction, 1.0);
            vec2 corner = vec2(passage.pixel);
            vec2 place = clamp((clip.xy / clip.w * 0.5 + 0.5) * size, corner, corner + 1.0);
            return Hit(place, passage.pixel, passage.distance, sure * passage.confidence);
        }
        share = end;
        enters = leaves;
    }
    return none;
}

// Falls to 0 at the picture's edges and at the end of the reach.
float fade(vec2 place, float distance) {
    vec2 inside = place / vec2(textureSize(gbuffer_position, 0));
    vec2 to_edge = min(inside, 1.0 - inside) / max(edge_fade, 1e-6);
    float to_end = (reach - distance) / (REACH_FADE * reach);
    return clamp(min(min(to_edge.x, to_edge.y), to_end), 0.0, 1.0);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(incoming)))) {
        return;
    }
    vec4 found = vec4(0.0), seen = vec4(0.0);
    vec4 ray = texelFetch(rays, pixel, 0);
    if (ray.w > 0.0) {
        Hit hit = follow(Ray(texelFetch(gbuffer_position, pixel, 0).xyz, ray.xyz), pixel);
        float confidence = hit.confidence * fade(hit.place, hit.distance);
        if (confidence > 0.0 && all(are_sound(vec4(hit.place, hit.distance, confidence)))) {
            found = vec4(confidence * sound_radiance(texelFetch(lit, hit.pixel, 0).rgb), confidence);
            seen = vec4(hit.place, hit.distance, confidence);
        }
    }
    imageStore(incoming, pixel, found);
    imageStore(hits, pixel, seen);
}
