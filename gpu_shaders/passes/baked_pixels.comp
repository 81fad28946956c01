// SPDX-License-Identifier: GPL-3.0-or-later
// Which rows of baked visibility count at each pixel, and how much: once for all lights.
#include "passes/gbuffer_samplers.glsl"
#include "lib/octree.glsl"
#include "lib/baked_visibility.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

// core.visibility_cells.VisibilityCells and core.baked_visibility.RowLists. cells: first zone and start of labels.
layout(std430, binding = CELL_BINDING) readonly buffer Cells { ivec2 cells[]; };
layout(std430, binding = LABEL_BINDING) readonly buffer Labels { uint labels[]; }; // four in a word
layout(std430, binding = COMPONENT_BINDING) readonly buffer Components { uint components[]; };
layout(std430, binding = LIST_OFFSET_BINDING) readonly buffer ListOffsets { uint list_offsets[]; };
layout(std430, binding = ENTRY_BINDING) readonly buffer Entries { uint entries[]; };
// Pixels whose zone was not found, and pixels without any row.
layout(std430, binding = COUNT_BINDING) buffer Counts { uint counts[2]; };

// Of each pixel, four words of lib/baked_visibility.glsl each, largest weights first.
layout(rgba32ui, binding = 0) writeonly uniform uimage2D first_rows;
layout(rgba32ui, binding = 1) writeonly uniform uimage2D second_rows;
layout(rgba32ui, binding = 2) writeonly uniform uimage2D third_rows;

uniform vec4 frame;             // of voxel coordinates: lower corner, and voxels for each unit
uniform int cells_per_axis;
uniform int component_count;
uniform vec3 eye;               // from the local origin
uniform vec3 backward;
uniform bool is_orthographic;
uniform ivec2 picture_size;

// The largest ones and the first that is left out.
uint words[MOST_ENTRIES + 1];
float weights[MOST_ENTRIES + 1];

ivec3 cell_of_place(vec3 place) {
    return clamp(ivec3(floor(place / float(CELL_SIDE))) + 1, ivec3(0), ivec3(cells_per_axis - 1));
}

int number_of(ivec3 place, int per_axis) {
    return (place.x * per_axis + place.y) * per_axis + place.z;
}

// The zone that holds a place in voxel coordinates; -1 where its voxel is occupied.
int zone_at(vec3 place) {
    ivec3 voxel = clamp(octree_cell(place) + CELL_SIDE, ivec3(0), ivec3(CELL_SIDE * cells_per_axis - 1));
    ivec2 cell = cells[number_of(voxel / CELL_SIDE, cells_per_axis)];
    if (cell.y < 0) {
        return cell.x;
    }
    int at = cell.y * (CELL_SIDE * CELL_SIDE * CELL_SIDE) + number_of(voxel % CELL_SIDE, CELL_SIDE);
    int label = int(bytes_of_words(uvec4(labels[at / 4]), uint(at)).x);
    return label == 0 ? -1 : cell.x + label - 1;
}

// The list of rows that count over a surface point. towards_eye: unit; what is seen from there is on the point's side of
// every wall, so where something fills the voxel over it, its zone is that of what lies before it.
int list_at(vec3 over, vec3 towards_eye) {
    ivec3 block = clamp(ivec3(floor(over / float(CELL_SIDE) + 0.5)) + 1, ivec3(0), ivec3(cells_per_axis));
    for (int i = 0; i <= ESCAPE_STEPS; ++i) {
        vec3 place = over + float(i) * towards_eye;
        ivec3 corner = block - cell_of_place(place);
        int zone = zone_at(place);
        if (i > 0 && any(notEqual(corner, clamp(corner, 0, 1)))) {
            break;
        }
        if (zone >= 0) {
            corner = clamp(corner, 0, 1);
            return int(components[8 * zone + corner.x + 2 * corner.y + 4 * corner.z]);
        }
    }
    atomicAdd(counts[0], 1u);
    return component_count + number_of(block, cells_per_axis + 1);
}

void keep(uint row, float weight) {
    for (int i = 0; i <= MOST_ENTRIES; ++i) {
        if (weight > weights[i]) {
            float lesser = weights[i];
            uint word = words[i];
            weights[i] = weight;
            words[i] = row;
            weight = lesser;
            row = word;
        }
    }
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, picture_size)) || !pixel_shows_geometry(pixel)) {
        return;
    }
    vec3 position = texelFetch(gbuffer_position, pixel, 0).xyz;
    vec3 geometric = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    vec3 normal = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 over = octree_place(position, frame) + geometric * octree_reach(geometric);
    int list = list_at(over, is_orthographic ? backward : normalize(eye - position));
    vec3 fraction = fract(over / float(CELL_SIDE) + 0.5);
    float total = 0.0;
    for (int i = 0; i <= MOST_ENTRIES; ++i) {
        weights[i] = 0.0;
        words[i] = 0u;
    }
    uint end = list_offsets[list + 1];
    for (uint i = list_offsets[list]; i < end; ++i) {
        float weight = baked_nearness(entries[i], fraction) * baked_facing(entries[i], normal);
        total += weight;
        keep(baked_row(entries[i]), weight);
    }
    float left_out = weights[MOST_ENTRIES], sum = 0.0;
    for (int i = 0; i < MOST_ENTRIES; ++i) {
        weights[i] -= left_out;
        sum += weights[i];
    }
    bool has_row = total >= LEAST_WEIGHT && sum > 0.0;
    if (!has_row) {
        atomicAdd(counts[1], 1u);
    }
    uint stored[MOST_ENTRIES];
    for (int i = 0; i < MOST_ENTRIES; ++i) {
        stored[i] = has_row ? packed_baked_row(words[i], weights[i] / sum) : 0u;
    }
    imageStore(first_rows, pixel, uvec4(stored[0], stored[1], stored[2], stored[3]));
    imageStore(second_rows, pixel, uvec4(stored[4], stored[5], stored[6], stored[7]));
    imageStore(third_rows, pixel, uvec4(stored[8], stored[9], stored[10], stored[11]));
}
