# SPDX-License-Identifier: GPL-3.0-or-later
"""Is the way between two points free of occupied voxels? Many segments at once, as `gpu_shaders/lib/octree.glsl`.

The document walks by parameters along the ray and adds a length that the user chooses so that it never stands still
(seed 004, 3.2). Here the state is the voxel, three integers. Each step leaves the largest empty cube around it through
one face, towards the last voxel and never past it along any axis, so the walk ends. Rounding may only decide in which
order faces are crossed. Voxels that follow each other share a face or are joined by empty ones, and where a surface has
no hole such a way cannot lead through it without a voxel that the surface meets: no rounding lets light through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .voxel_octree import BRICK_LEVELS, CHILD_MASK, MASK_BITS, Bools, Int64, VoxelOctree

Floats = npt.NDArray[Any]

FAR_OUTSIDE = 1 << 20
"""Voxels farther outside than this are taken to be this far."""
SLACK = 2.0**-9
"""Voxels are found up to 2^-11 of a voxel from a surface, and coordinates in a float32 walk are off by as much."""

_BIT_COUNTS = np.array([bits.bit_count() for bits in range(CHILD_MASK + 1)], np.int64)


@dataclass(frozen=True)
class VoxelBoxes:
    """What a tree knows around voxels. low, high: (n, 3) first and last voxel of the largest cube of the tree, empty or
    one voxel, that holds each; outside the tree a half space. occupied: (n,)."""

    low: Int64
    high: Int64
    occupied: Bools


def cells_at(places: Floats) -> Int64:
    """(n, 3) the voxels that hold (n, 3) points in voxel coordinates."""
    return np.floor(np.clip(places, -FAR_OUTSIDE, FAR_OUTSIDE)).astype(np.int64)


def boxes_at(tree: VoxelOctree, cells: Int64) -> VoxelBoxes:
    """What `tree` knows around (n, 3) voxels."""
    size = 1 << tree.depth
    inside = ((cells >= 0) & (cells < size)).all(axis=1)
    rows = np.flatnonzero(inside)
    within = cells[rows]
    # How many levels down from the root there are nodes, bricks and at last a voxel that hold the cell.
    levels = np.zeros(len(cells), np.int64)
    at = np.zeros(len(rows), np.int64)
    for level in range(tree.depth):
        octant = _octants(within, tree.depth - level - 1)
        height = tree.depth - level
        if height > BRICK_LEVELS:
            words = tree.nodes[at].astype(np.int64)
            below = words & ((1 << octant) - 1)
            at = (words >> MASK_BITS) + _BIT_COUNTS[below]
            found = (words >> octant & 1) != 0
        elif height == BRICK_LEVELS:
            at = (tree.bricks[at] >> (8 * octant).astype(np.uint64)).astype(np.int64) & CHILD_MASK
            found = at != 0
        else:
            found = (at >> octant & 1) != 0
        rows, within, at = rows[found], within[found], at[found]
        levels[rows] += 1
    occupied = levels == tree.depth
    side = 1 << np.maximum(tree.depth - levels - 1, 0)[:, None]
    low = cells // side * side
    return _with_outside(VoxelBoxes(low, low + side - 1, occupied), cells, inside, size)


def _with_outside(boxes: VoxelBoxes, cells: Int64, inside: Bools, size: int) -> VoxelBoxes:
    below, above = cells < 0, cells >= size
    out = ~inside[:, None]
    low = np.where(out, np.where(above, size, -4 * FAR_OUTSIDE), boxes.low)
    high = np.where(out, np.where(below, -1, 4 * FAR_OUTSIDE), boxes.high)
    return VoxelBoxes(low, high, boxes.occupied)


def _octants(cells: Int64, shift: int) -> Int64:
    bits = cells >> shift & 1
    return np.asarray(bits[:, 0] | bits[:, 1] << 1 | bits[:, 2] << 2)


def segments_clear(tree: VoxelOctree, starts: Floats, ends: Floats) -> Bools:
    """(n,) whether no voxel between (n, 3) start and end in voxel coordinates, both included, is occupied.

    False for what is not finite. The arithmetic is that of the points' type: float32 as on the device.
    """
    clear = np.zeros(len(starts), bool)
    rows = finite_segments(starts, ends)
    cells = cells_at(starts[rows])
    while len(rows):
        boxes = boxes_at(tree, cells)
        clear[rows] = ~boxes.occupied
        going = ~boxes.occupied
        rows, cells = next_cells(rows[going], cells[going], boxes.low[going], boxes.high[going], starts, ends)
    return clear


def finite_segments(starts: Floats, ends: Floats) -> Int64:
    """Rows of those whose ends are finite."""
    return np.flatnonzero(np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1))


def next_cells(rows: Int64, cells: Int64, low: Int64, high: Int64, starts: Floats, ends: Floats) -> tuple[Int64, Int64]:
    """The ways that go on beyond the cubes of voxels from `low` to `high` that hold their cells, and where they are
    then. rows: (n,) of starts and ends; the rest for each of those."""
    lasts = cells_at(ends[rows])
    step = np.sign(lasts - cells)
    far = np.where(step > 0, high, low)
    leaves = ((step > 0) & (lasts > far)) | ((step < 0) & (lasts < far))
    going = leaves.any(axis=1)
    rows, step, far, leaves, lasts = rows[going], step[going], far[going], leaves[going], lasts[going]
    return rows, _next_cells(cells[going], starts[rows], ends[rows], far, step, leaves, lasts)


def _next_cells(
    cells: Int64, starts: Floats, ends: Floats, far: Int64, step: Int64, leaves: Bools, lasts: Int64
) -> Int64:
    """The first voxel beyond a cube. far: its last voxels along the way; leaves: axes along which the end is beyond."""
    along = ends - starts
    planes = (far + (step > 0)).astype(starts.dtype)
    with np.errstate(divide="ignore", invalid="ignore"):
        fractions = np.where(leaves, (planes - starts) / along, np.inf)
    axis = np.argmin(fractions, axis=1)
    row = np.arange(len(cells))
    at = starts + along * fractions[row, axis][:, None]
    # Not back, not out of the cube but where it is left, and not past the last voxel.
    limit = np.where(step > 0, np.minimum(far, lasts), np.maximum(far, lasts))
    moved = np.clip(cells_at(at), np.minimum(cells, limit), np.maximum(cells, limit))
    moved[row, axis] = (far + step)[row, axis]
    return moved


def reaches(normals: Floats) -> Floats:
    """(n,) how many voxels along its unit normal a point has to be over a plane for its own voxel not to touch it: the
    extent of a voxel along the normal. 0 for no normal."""
    return np.asarray(np.abs(normals).sum(axis=1) * (1.0 + SLACK))


def lifted(places: Floats, normals: Floats, others: Floats, other_normals: Floats) -> Floats:
    """(n, 3) where ways from surface points to others begin, in voxel coordinates: as `lifted_by` by the reach of each,
    so that neither surface's voxels stand in the way, nor floor and wall where they meet."""
    return lifted_by(reaches(normals), reaches(other_normals), places, normals, others, other_normals)


def lifted_by(
    own: Floats, other: Floats, places: Floats, normals: Floats, others: Floats, other_normals: Floats
) -> Floats:
    """(n, 3) places moved over their own plane by (n,) `own` and over the other's by `other`.

    Normals are unit and geometric, or zero for a point in space. A point moves by `own` and at most twice `other`.
    """
    begins = places + normals * own[:, None]
    missing = other - np.einsum("ij,ij->i", other_normals, begins - others)
    # Along the other normal, but not back towards the own plane. Planes that face each other have no such way.
    facing = np.minimum(np.einsum("ij,ij->i", normals, other_normals), 0.0)
    share = np.maximum(missing, 0.0) / np.maximum(1.0 - facing * facing, 0.25)
    return np.asarray(begins + (other_normals - facing[:, None] * normals) * share[:, None])


def surfaces_see(
    trees: Sequence[VoxelOctree], places: Floats, normals: Floats, others: Floats, other_normals: Floats
) -> Bools:
    """(n,) whether surface points see others, in voxel coordinates; True where they are too near for voxels to tell."""
    starts, ends = lifted(places, normals, others, other_normals), lifted(others, other_normals, places, normals)
    near = np.einsum("ij,ij->i", ends - starts, others - places) <= 0.0
    return near | np.all([segments_clear(tree, starts, ends) for tree in trees], axis=0)
