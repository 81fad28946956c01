// SPDX-License-Identifier: GPL-3.0-or-later
// Places along the Z-order curve (Morton 1966) and cells in one word; as core/voxel_octree.py orders nodes.
#ifndef LIB_Z_ORDER
#define LIB_Z_ORDER

// The lower 10 bits, each moved to every third place.
uint every_third_bit(uint bits) {
    bits = (bits | bits << 16) & 0x030000FFu;
    bits = (bits | bits << 8) & 0x0300F00Fu;
    bits = (bits | bits << 4) & 0x030C30C3u;
    return (bits | bits << 2) & 0x09249249u;
}

// The bits at places 0, 3, 6 …, moved together: the reverse of every_third_bit.
uint gathered_bits(uint code) {
    uint bits = code & 0x09249249u;
    bits = (bits | bits >> 2) & 0x030C30C3u;
    bits = (bits | bits >> 4) & 0x0300F00Fu;
    bits = (bits | bits >> 8) & 0x030000FFu;
    return (bits | bits >> 16) & 0x000003FFu;
}

// Place of a cell along the curve, at most 10 bits along each axis; x has the lowest bit.
uint z_order(uvec3 cell) {
    return every_third_bit(cell.x) | every_third_bit(cell.y) << 1 | every_third_bit(cell.z) << 2;
}

// The cell at a place along the curve.
uvec3 cell_at(uint code) {
    return uvec3(gathered_bits(code), gathered_bits(code >> 1), gathered_bits(code >> 2));
}

#endif
