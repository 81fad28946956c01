# SPDX-License-Identifier: GPL-3.0-or-later
"""A sparse voxel octree of the surface: which voxels hold a piece of a triangle (seed 004, 3.1 and 4.3).

The document's node is four words: flags and a pointer to eight children, a pointer to data and the node's box. Boxes
follow from the way down, children that are empty need no place, and visibility needs no data, so here a node is one
word: its lower 8 bits say which of the octants have children, the upper 24 where the first of those stands; the others
follow it. The lowest two levels are one 64-bit mask, a brick of 4 x 4 x 4 voxels: a voxel costs some bits, not 16
bytes. Levels follow each other from the root down, each in the order of the Z-order curve, so the same voxels are the
same tree, bit for bit. Octants are x + 2 y + 4 z; a voxel's place in its brick is 8 times the octant of
2 x 2 x 2 voxels plus its own in there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .morton import spread_bits
from .scene import Float64
from .triangle_box import triangles_meet_cubes

Int64 = npt.NDArray[np.int64]
UInt32 = npt.NDArray[np.uint32]
UInt64 = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]

BRICK_LEVELS = 2
"""Levels of the octree in one brick."""
BRICK_SIDE = 1 << BRICK_LEVELS
MASK_BITS = 8
CHILD_MASK = (1 << MASK_BITS) - 1
MOST_NODES = 1 << (32 - MASK_BITS)
"""On one level: as many as a node's word can name."""

_OCTANTS = np.array([(i & 1, i >> 1 & 1, i >> 2 & 1) for i in range(8)], np.int64)
# Blocks of eight cells that are tested at once: some 100 MB.
_BLOCKS_AT_ONCE = 1 << 15


@dataclass(frozen=True)
class VoxelOctree:
    """depth: 2^depth voxels along each axis. nodes: (n,) uint32, the root first; children of the last level's nodes are
    bricks. level_starts: (depth - 1,) int64, where levels begin in nodes, and their number. bricks: (b,) uint64."""

    depth: int
    nodes: UInt32
    level_starts: Int64
    bricks: UInt64

    @property
    def nbytes(self) -> int:
        """Of nodes and bricks."""
        return self.nodes.nbytes + self.bricks.nbytes

    @property
    def voxel_count(self) -> int:
        """Voxels that hold a piece of a triangle."""
        return int(np.unpackbits(self.bricks.view(np.uint8)).sum())

    def voxels(self) -> Int64:
        """(v, 3) the voxels that hold a piece of a triangle, in the tree's order."""
        return self.cells(self.depth)

    def cells(self, level: int) -> Int64:
        """(n, 3) the cells of 2^level along each axis that hold a piece of a triangle, in the tree's order."""
        codes = np.zeros(int(len(self.bricks) > 0), np.int64)
        for upper in range(min(level, self.depth - BRICK_LEVELS)):
            masks = self.nodes[self.level_starts[upper] : self.level_starts[upper + 1]] & CHILD_MASK
            codes = _expanded(codes, masks[:, None].astype(np.uint8))
        octants = self.bricks.view(np.uint8).reshape(-1, 8)
        if level == self.depth - 1:
            codes = _expanded(codes, np.packbits(octants > 0, axis=1, bitorder="little"))
        elif level == self.depth:
            codes = _expanded(codes, octants)
        return np.stack([_gathered_bits(codes >> axis) for axis in range(3)], axis=1)


def build_octree(places: Float64, depth: int, growth: float = 0.0) -> VoxelOctree:
    """The octree of all voxels of 2^depth along each axis that meet a triangle of (t, 3, 3) `places`.

    places: corners in voxel coordinates (VoxelFrame.voxels). growth: every voxel is larger by so much on each side.
    Raises InvalidInput for corners that are not finite or outside the cube.
    """
    require_places(places, depth)
    codes = voxel_codes(places, depth, growth)
    return tree_of_codes(codes, depth)


def require_places(places: Float64, depth: int) -> None:
    """Raises InvalidInput for corners that are not finite or outside the cube of 2^depth voxels along each axis."""
    inside = ((places >= 0.0) & (places <= 1 << depth)).all(axis=(1, 2))
    if not inside.all():
        triangle = int(np.argmin(inside))
        corners = places[triangle].tolist()
        remedy = "make the frame from the bounds of all that is voxelised"
        raise InvalidInput(f"voxelisation, triangle {triangle}", f"corners {corners} outside the voxels", remedy)


def voxel_codes(places: Float64, depth: int, growth: float = 0.0) -> Int64:
    """(v,) int64 ascending places along the Z-order curve of the voxels that meet a triangle; as `build_octree`."""
    found = [np.unique(codes) for _, codes in meeting_voxels(places, depth, growth)]
    return np.unique(np.concatenate([np.zeros(0, np.int64), *found]))


def meeting_voxels(places: Float64, depth: int, growth: float = 0.0) -> Iterator[tuple[Int64, Int64]]:
    """Triangles and voxels of all pairs that meet, in parts: triangles, and places along the Z-order curve."""
    blocks = starting_blocks(places, depth, depth, growth)
    waiting = [
        (level, np.flatnonzero(blocks.levels == level), blocks.cells[blocks.levels == level])
        for level in np.unique(blocks.levels).tolist()
    ]
    while waiting:
        level, triangles, cells = waiting.pop()
        for start in range(0, len(triangles), _BLOCKS_AT_ONCE):
            part = slice(start, start + _BLOCKS_AT_ONCE)
            meeting = _cells_that_meet(places, triangles[part], cells[part], depth - level, growth)
            if level == depth:
                yield meeting[0], codes_of(meeting[1])
            else:
                waiting.append((level + 1, meeting[0], 2 * meeting[1]))


def _cells_that_meet(
    places: Float64, triangles: Int64, first_cells: Int64, height: int, growth: float
) -> tuple[Int64, Int64]:
    """Triangles and cells of the pairs that meet, from triangles and the blocks of 2 x 2 x 2 cells where they may;
    height: levels from the cells down to voxels."""
    triangles, cells = np.repeat(triangles, 8), (first_cells[:, None] + _OCTANTS).reshape(-1, 3)
    side = float(1 << height)
    # The box of a triangle that has just been cut is tested first, and most pairs end there.
    meets = triangles_meet_cubes(places[triangles], (cells + 0.5) * side, 0.5 * side + growth)
    return triangles[meets], cells[meets]


@dataclass(frozen=True)
class StartingBlocks:
    """Where to begin to look for the cells that triangles meet. Level l has 2^l cells along each axis. levels: (t,);
    cells: (t, 3) the first of 2 x 2 x 2 cells of that level that hold the triangle's box."""

    levels: Int64
    cells: Int64


def starting_blocks(places: Float64, depth: int, deepest: int, growth: float) -> StartingBlocks:
    """The level whose cells are at least twice as large as each triangle's box, but from 1 to `deepest`."""
    # Several times as fast as reductions over an axis of three.
    a, b, c = (places[:, corner] for corner in range(3))
    low, high = np.minimum(np.minimum(a, b), c) - growth, np.maximum(np.maximum(a, b), c) + growth
    x, y, z = (high - low).T
    extent = np.maximum(np.maximum(x, y), np.maximum(z, 0.5))
    levels = np.clip(np.floor(depth - 1 - np.log2(extent)), 1, deepest).astype(np.int64)
    cells_along = (1 << levels).astype(np.float64)[:, None]
    # What touches a face meets the cells on both sides of it.
    cells = np.clip(np.ceil(low * (cells_along * 2.0**-depth)) - 1, 0, cells_along - 2)
    return StartingBlocks(levels, cells.astype(np.int64))


def tree_of_codes(codes: Int64, depth: int) -> VoxelOctree:
    """The octree of voxels given by their ascending places along the Z-order curve.

    Raises InvalidInput where a level has more nodes than a word can name.
    """
    if not len(codes):
        starts = np.ones(depth - BRICK_LEVELS + 1, np.int64)
        starts[0] = 0
        return VoxelOctree(depth, np.zeros(1, np.uint32), starts, np.zeros(0, np.uint64))
    bricks = _parents_masks(codes, 3 * BRICK_LEVELS)
    masks, counts = bricks[1], [len(bricks[0])]
    level_codes = bricks[0]
    words: list[tuple[UInt64, Int64]] = []
    for _ in range(depth - BRICK_LEVELS):
        parents, octants, firsts = _parents_masks(level_codes, 3)
        words.insert(0, (octants, firsts))
        counts.insert(0, len(parents))
        level_codes = parents
    if max(counts) > MOST_NODES:
        raise InvalidInput("voxel octree", f"{max(counts):,} nodes on one level", "use a lower resolution")
    starts = np.cumsum([0, *counts[:-1]])
    # Nodes name their children by their place among all nodes, bricks among bricks.
    child_starts = [*starts[1:-1], 0]
    nodes = [
        octants.astype(np.uint32) | (firsts + start).astype(np.uint32) << MASK_BITS
        for (octants, firsts), start in zip(words, child_starts, strict=True)
    ]
    return VoxelOctree(depth, np.concatenate(nodes).astype(np.uint32), starts, masks)


def _parents_masks(codes: Int64, bits: int) -> tuple[Int64, UInt64, Int64]:
    """Codes without their lower `bits`, each once; which of those lower bits occur, as a mask; where each begins."""
    parents, firsts = np.unique(codes >> bits, return_index=True)
    flags = np.uint64(1) << (codes & ((1 << bits) - 1)).astype(np.uint64)
    return parents, np.bitwise_or.reduceat(flags, firsts), firsts


def _expanded(codes: Int64, masks: npt.NDArray[np.uint8]) -> Int64:
    """Codes of the children that (n, k) bytes name, lowest bit first."""
    bits = np.unpackbits(masks, axis=1, bitorder="little")
    rows, children = np.nonzero(bits)
    return codes[rows] * bits.shape[1] + children


def codes_of(cells: Int64) -> Int64:
    """(n,) places along the Z-order curve of (n, 3) voxels; x has the lowest bit."""
    x, y, z = (spread_bits(cells[:, axis]) for axis in range(3))
    return np.asarray(x | y << 1 | z << 2)


def _gathered_bits(codes: Int64) -> Int64:
    """Every third bit of the codes, moved together: the reverse of `spread_bits` for 10 bits and more."""
    values = codes & 0x1249249249249249
    for shift, mask in (
        (2, 0x10C30C30C30C30C3),
        (4, 0x100F00F00F00F00F),
        (8, 0x1F0000FF0000FF),
        (16, 0x1F00000000FFFF),
        (32, 0x1FFFFF),
    ):
        values = (values | values >> shift) & mask
    return values
