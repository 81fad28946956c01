// SPDX-License-Identifier: GPL-3.0-or-later
// A ray as a line in a picture, for marching through what the picture shows (seed 003, 4.2.4).
#ifndef LIB_SCREEN_RAY
#define LIB_SCREEN_RAY

struct ScreenRay {
    vec2 start;     // pixels, from the lower left corner
    vec2 span;      // pixels, from the start to where the ray ends
    float end;      // share of the span at which the ray leaves the picture, at most 1; 0 for no ray
    float reach;    // m, from the ray's origin to its end
    vec2 scales;    // homogeneous coordinate at both ends, above 0
};

// origin, direction: m from the local origin, and unit. size: of the picture, pixels. reach: m, at most. nearest: the
// ray ends where the homogeneous coordinate falls below it; a ray that starts there is none.
ScreenRay make_screen_ray(mat4 clip_from_local, vec2 size, vec3 origin, vec3 direction, float reach, float nearest) {
    vec4 first = clip_from_local * vec4(origin, 1.0);
    vec4 rate = clip_from_local * vec4(direction, 0.0);
    if (rate.w < 0.0) {
        reach = min(reach, (first.w - nearest) / -rate.w);
    }
    if (!(first.w >= nearest) || !(reach > 0.0)) {
        return ScreenRay(vec2(0.0), vec2(0.0), 0.0, 0.0, vec2(1.0));
    }
    vec4 last = first + reach * rate;
    last.w = max(last.w, nearest);
    vec2 start = (first.xy / first.w * 0.5 + 0.5) * size;
    vec2 span = (last.xy / last.w * 0.5 + 0.5) * size - start;
    vec2 leaves = vec2(1.0);
    for (int axis = 0; axis < 2; ++axis) {
        if (span[axis] != 0.0) {
            leaves[axis] = ((span[axis] > 0.0 ? size[axis] : 0.0) - start[axis]) / span[axis];
        }
    }
    float end = clamp(min(leaves.x, leaves.y), 0.0, 1.0);
    return ScreenRay(start, span, end, reach, vec2(first.w, last.w));
}

// m from the ray's origin to where it is after a share of its span.
float ray_distance(ScreenRay ray, float share) {
    float from_start = share * ray.scales.x;
    return ray.reach * from_start / ((1.0 - share) * ray.scales.y + from_start);
}

// How far on a place counts as beyond a border that it is on, pixels.
#define BEYOND_BORDER (1.0 / 128.0)

// Share of the span at which the ray leaves the square of 2^level pixels that it is in after `share`, at most its end.
// square: is set to which one that is, column and row.
float square_end(ScreenRay ray, float share, int level, out ivec2 square) {
    vec2 place = ray.start + share * ray.span + BEYOND_BORDER * sign(ray.span);
    square = ivec2(floor(place)) >> level;
    float end = ray.end;
    for (int axis = 0; axis < 2; ++axis) {
        if (ray.span[axis] != 0.0) {
            int border = (square[axis] + int(ray.span[axis] > 0.0)) << level;
            end = min(end, (float(border) - ray.start[axis]) / ray.span[axis]);
        }
    }
    return max(end, share);
}

// The pixel that the ray has come through when it is at a border.
ivec2 pixel_before(ScreenRay ray, float share) {
    return ivec2(floor(ray.start + share * ray.span - BEYOND_BORDER * sign(ray.span)));
}

// A thing is taken to be as deep as the ray's way behind it is long across the picture: how sure it is that a ray has
// passed behind it, from how far behind it was.
float passed_share(float gap, float way) {
    return way > 0.0 ? clamp(gap / way, 0.0, 1.0) : 1.0;
}
#endif
