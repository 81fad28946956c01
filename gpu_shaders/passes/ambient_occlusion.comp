// SPDX-License-Identifier: GPL-3.0-or-later
// What one view of the scene tells of the surroundings of every pixel's surface (seed 003, 4.2.3 and 4.3.2). The kernel is
// points along directions as dense as the cosine; a direction is closed where one of its points lies behind what the view
// shows there, by no more than what shows may be thick: the range check. TELLS_POINTS writes what is known of each point,
// for passes/ambient_occlusion_join.comp; else the open directions and all are counted, by the weight of the view where
// it WEIGHS.
#include "passes/gbuffer_samplers.glsl"
#include "passes/ambient_occlusion_view.glsl"
#include "lib/directions.glsl"
#include "lib/spread_pattern.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

// A view's word always weighs something where it sees the receiver at all.
#define LEAST_WEIGHT 1e-4

#if TELLS_POINTS
layout(rgba32ui, binding = 0) uniform uimage2D told_points;
#else
layout(rg32f, binding = 0) uniform image2D sums;    // open directions, and all; by weight
#endif

uniform float scale;        // with the offset takes a pixel's place into the space of the view
uniform vec3 offset;
uniform float radius;       // m, in the view's space
uniform int first_direction, end_direction; // of this run
uniform int directions, steps;
uniform float distance_share;   // of the distance weight in the whole
uniform uint sample_index;

// What of a pixel's kernel a view has seen. told: of its points, two bits each.
struct Word {
    uvec4 told;
    float open;     // directions
    float nearness; // mean of what the view shows at the points: 1 at the receiver, 0 at the radius and beyond
};

// A direction of the kernel of a pixel, and in (0, 1] how far the first of its points is from the surface.
vec4 kernel_direction(ivec2 pixel, int index, vec3 normal) {
    vec2 random = spread_pattern(uvec2(pixel), uint(index), sample_index);
    vec3 direction = cosine_direction(normal, vec2((float(index) + random.x) / float(directions), random.y));
    return vec4(direction, 1.0 - spread_random(uvec2(pixel), uint(index), sample_index));
}

// Looks along the kernel's directions over p, whose triangle has the unit normal `plane`. trusts_thickness: whether
// points behind what the view shows may be taken to be in it.
Word look_around(ivec2 pixel, vec3 p, vec3 normal, vec3 plane, bool trusts_thickness, uvec4 told) {
    Word word = Word(told, 0.0, 0.0);
    float looked = 0.0;
    for (int i = first_direction; i < end_direction; ++i) {
        vec4 direction = kernel_direction(pixel, i, normal);
        int first_point = (i - first_direction) * steps;
        bool is_open = dot(direction.xyz, plane) > 0.0;
        if (!is_open) {
            tell(word.told, first_point, POINT_CLOSED);
        }
        vec3 before = p;
        uint found_before = POINT_FREE;
        Shown shown_before = Shown(p, vec3(0.0), 0.0, false);
        for (int j = 0; j < steps && is_open; ++j) {
            // The last point is at the radius, so that nothing within it lies beyond all points.
            float part = (float(j) + direction.w) / (float(steps - 1) + direction.w);
            float far = radius * part * part;
            vec3 x = p + far * direction.xyz;
            Shown shown = shown_at(x);
            uint found = look(shown, x, before, far);
            found = found == POINT_ASSUMED && !trusts_thickness ? POINT_UNKNOWN : found;
            word.nearness += shows_geometry(shown.normal) ? max(1.0 - distance(shown.place, p) / radius, 0.0) : 0.0;
            looked += 1.0;
#if TELLS_POINTS
            // From before a surface to behind it, or out from behind one.
            bool goes_in = found != POINT_FREE && leads_through(shown, before, x, p);
            bool comes_out = found_before != POINT_FREE && leads_through(shown_before, before, x, p);
            tell(word.told, first_point + j, goes_in || comes_out ? POINT_CLOSED : found);
            found_before = found;
            shown_before = shown;
#else
            is_open = !is_in_the_way(found);
#endif
            before = x;
        }
        word.open += is_open ? 1.0 : 0.0;
    }
    word.nearness /= max(looked, 1.0);
    return word;
}

// Weight of what the view makes of a point (seed 003, 4.3.2). cosine: between its normal and the way to the view's eye.
float weight_of(float cosine, float nearness) {
    float weight = mix(max(cosine, 0.0), nearness, distance_share);
    // As a whole number: drivers may take any comparison with NaN for true.
    bool is_usable = (floatBitsToUint(weight) & 0x7fffffffu) <= floatBitsToUint(1.0);
    return is_usable ? max(weight, LEAST_WEIGHT) : LEAST_WEIGHT;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(gbuffer_position, 0))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    vec3 p = scale * texelFetch(gbuffer_position, pixel, 0).xyz + offset;
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 plane = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    bool sees_receiver = VIEW_IS_MAP == 0 || is_seen(p, plane);
#if TELLS_POINTS
    uvec4 told = uvec4(0u);
#if VIEW_IS_MAP
    told = imageLoad(told_points, pixel);
#endif
    // What stands between a lamp and a receiver may be a wall, and the receiver close behind it.
    imageStore(told_points, pixel, look_around(pixel, p, normal, plane, sees_receiver, told).told);
#else
    if (sees_receiver) {
        Word word = look_around(pixel, p, normal, plane, true, uvec4(0u));
        float weight = WEIGHS == 1 ? weight_of(dot(normal, direction_to_eye(p)), word.nearness) : 1.0;
        vec2 sum = imageLoad(sums, pixel).xy + weight * vec2(word.open, float(end_direction - first_direction));
        imageStore(sums, pixel, vec4(sum, 0.0, 0.0));
    }
#endif
}
