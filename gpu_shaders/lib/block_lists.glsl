// SPDX-License-Identifier: GPL-3.0-or-later
// Where a point's cell is in the lists of core/block_lists.py: lights of block b are those from offsets[b] to before
// offsets[b + 1], and a light reaches the cell where `has_cell` of its mask is true.
#ifndef LIB_BLOCK_LISTS
#define LIB_BLOCK_LISTS

// The cell that holds a point of the grid's frame, or the nearest one. low, high: corners of the grid; cells: per axis.
uvec3 cell_of(vec3 point, vec3 low, vec3 high, uint cells) {
    vec3 place = (point - low) / (high - low) * float(cells);
    return uvec3(clamp(place, vec3(0.0), vec3(float(cells) - 0.5)));
}

// The block of 4 x 4 x 4 cells that holds a cell. cells: of the grid per axis.
uint block_of(uvec3 cell, uint cells) {
    uint blocks = (cells + 3u) / 4u;
    uvec3 block = cell / 4u;
    return (block.z * blocks + block.y) * blocks + block.x;
}

// Whether a mask has the bit of a cell of its block.
bool has_cell(uvec2 mask, uvec3 cell) {
    uvec3 place = cell % 4u;
    uint word = place.z < 2u ? mask.x : mask.y;
    return (word >> (place.x + 4u * place.y + 16u * (place.z % 2u)) & 1u) != 0u;
}

#endif
