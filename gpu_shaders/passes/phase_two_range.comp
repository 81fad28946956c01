// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of every pixel from the lights in the list of its cell of a light grid (seed 002, 4.3), added to what other
// grids gave. A pixel outside the grid gets the lights whose active hemisphere holds it. Or (PICKS) some of these lights.
#include "gpu_layout/VirtualLight"
#define TILE_ACCESS readonly
#include "passes/tile_pixels.glsl"
#include "passes/light_sum.glsl"
#include "lib/active_hemisphere.glsl"
#include "lib/block_lists.glsl"

#define BATCH 64u

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused
layout(std430, binding = LIST_OFFSET_BINDING) readonly buffer ListOffsets { uint list_offsets[]; };
layout(std430, binding = LIST_BINDING) readonly buffer Entries { uint entries[]; };
layout(std430, binding = MASK_BINDING) readonly buffer Masks { uvec2 masks[]; };
layout(std430, binding = HALF_BALL_BINDING) readonly buffer HalfBalls { HalfBall half_balls[]; };

// Of the grid's frame: places are frame_scale times a position plus frame_offset.
uniform float frame_scale;
uniform vec3 frame_offset;
uniform vec3 low;
uniform vec3 high;
uniform uint cells;
uniform uint light_count;
// A run within each list.
uniform uint first_entry;
uniform uint end_entry;

void meet_light(uint i, int k) {
    VirtualLight light = lights[i];
    float factor = triangle_form_factor(
        positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius);
    meet(k, i, IS_LEFT_OUT(light.tag_id, k) ? vec3(0.0) : factor * radiosities[i].rgb);
}

// After the `found`th light.
void end_full_batch(uint found) {
    if (found % BATCH == 0u) {
        end_batch();
        start_batch();
    }
}

// Looks for the next light of its own before it computes one, so that invocations that run in step compute together
// though they find theirs at different places.
void meet_cell(vec3 place, int k) {
    uvec3 cell = cell_of(place, low, high, cells);
    uint block = block_of(cell, cells);
    uint start = list_offsets[block], stop = list_offsets[block + 1u];
    uint end = min(start + end_entry, stop);
    uint i = min(start + first_entry, stop);
    for (uint found = 1u; ; ++found) {
        while (i < end && !has_cell(masks[i], cell)) {
            ++i;
        }
        if (i >= end) {
            break;
        }
        meet_light(entries[i], k);
        ++i;
        end_full_batch(found);
    }
}

bool holds(HalfBall half_ball, vec3 place) {
    // Exact for a point.
    return may_overlap(half_ball, place - half_ball.centre, place - half_ball.centre);
}

void meet_outside(vec3 place, int k) {
    uint end = min(end_entry, light_count);
    uint i = first_entry;
    for (uint found = 1u; ; ++found) {
        while (i < end && !holds(half_balls[i], place)) {
            ++i;
        }
        if (i >= end) {
            break;
        }
        meet_light(i, k);
        ++i;
        end_full_batch(found);
    }
}

void main() {
    uint tile = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (tiles[tile].half_extent.x < 0.0) {
        return;
    }
    fetch_pixels(tile);
    start_sums(tile);
    for (int k = 0; k < PIXELS; ++k) {
        if (shown[k]) {
            vec3 place = frame_scale * positions[k] + frame_offset;
            // What lies on the grid's face does not leave it by rounding.
            bool is_inside = all(greaterThanEqual(place, low - FACE_SLACK)) && all(lessThanEqual(place, high + FACE_SLACK));
            start_batch();
            if (is_inside) {
                meet_cell(place, k);
            } else {
                meet_outside(place, k);
            }
            end_batch();
        }
    }
    store_sums(tile);
}
