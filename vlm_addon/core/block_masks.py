# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the 4 x 4 x 4 cells of a block a half ball reaches, as the bits of one integer: `overlaps` for each cell.

Every sum that `overlaps` compares adds one term of each axis, (x + y) + z, and rounding is monotonic. So the terms of
the four cells along each axis give those of all 64 cells, and the least and greatest terms bound all 64 to the last
bit: most blocks are decided as a whole, and no answer differs from that of `overlaps`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import Bools, Floats, HalfBalls, plane_overlaps
from .scene import Float32

SIDE = 4
"""Cells along a block."""
CELLS = SIDE**3

Ints = npt.NDArray[Any]
Masks = npt.NDArray[np.uint64]

# Terms of a cell along an axis: squared distance of its nearest and of its farthest point from the centre, greatest
# height over the plane, height of its nearest point.
NEAR, FAR, HEIGHT, NEAR_HEIGHT = range(4)
# Bounds of a block's cells.
_LEAST_NEAR, _MOST_NEAR, _MOST_FAR, _LEAST_HEIGHT, _MOST_HEIGHT, _LEAST_NEAR_HEIGHT = range(6)


def block_edges(edges: Float32) -> Float32:
    """(3, b + 1) faces of the blocks of cells with (3, n + 1) faces; the last block may hold less than SIDE cells."""
    last = edges.shape[1] - 1
    return edges[:, np.minimum(np.arange(0, last + SIDE, SIDE), last)]


def expand(starts: Ints, counts: Ints) -> Ints:
    """starts[0], starts[0] + 1, … counts[0] values, then the same from starts[1], and so on; int64."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) + np.repeat(starts - ends + counts, counts)


class BlockTests:
    """The terms of half balls and the blocks in a box about each of them, and the masks that follow."""

    def __init__(self, half_balls: HalfBalls, edges: Float32, firsts: Ints, counts: Ints) -> None:
        """edges: (3, n + 1) float32, the cells' faces in the frame of the half balls (float32).

        firsts, counts: (3, m) the first block of each box and the number of blocks along each axis.
        """
        self._half_balls, self._edges, self._firsts = half_balls, edges, firsts
        self._starts = np.cumsum(counts, axis=1) - counts
        self._terms = [axis_terms(half_balls, edges, axis, firsts[axis], counts[axis]) for axis in range(3)]
        self._bounds = [_axis_bounds(terms) for terms in self._terms]
        self._cells = cells_along(edges.shape[1] - 1)

    def masks(self, members: Ints, offsets: Ints) -> Masks:
        """(m,) bits of the cells that half ball members[i] reaches in the block at offsets[:, i] in its box.

        Bit x + 4 y + 16 z stands for the block's cell x, y, z.
        """
        rows = np.take(self._starts, members, axis=1) + offsets
        places = np.take(self._firsts, members, axis=1) + offsets
        radii_squared = np.take(self._half_balls.radii_squared, members)
        x, y, z = (np.take(bounds, rows[axis], axis=1) for axis, bounds in enumerate(self._bounds))
        bounds = (x + y) + z
        touched = (bounds[_LEAST_NEAR] <= radii_squared) & (bounds[_MOST_HEIGHT] >= 0.0)
        inner, front = bounds[_MOST_FAR] <= radii_squared, bounds[_LEAST_NEAR_HEIGHT] >= 0.0
        whole = (inner & (bounds[_LEAST_HEIGHT] >= 0.0)) | (front & (bounds[_MOST_NEAR] <= radii_squared))
        masks = np.where(touched, ~np.uint64(0), np.uint64(0))
        partly = touched & ~whole
        # Where all cells are within the ball the plane decides; where all nearest points are in front, the ball.
        at = np.flatnonzero(partly & inner)
        masks[at] = packed(self._sums(HEIGHT, np.take(rows, at, axis=1)) >= 0.0)
        at = np.flatnonzero(partly & front & ~inner)
        masks[at] = packed(self._sums(NEAR, np.take(rows, at, axis=1)) <= radii_squared[at])
        at = np.flatnonzero(partly & ~front & ~inner)
        masks[at] = packed(self._reached(members[at], np.take(rows, at, axis=1), np.take(places, at, axis=1)))
        x_cells, y_cells, z_cells = (cells[places[axis]] for axis, cells in enumerate(self._cells))
        return masks & (x_cells * y_cells * z_cells)

    def _reached(self, members: Ints, rows: Ints, places: Ints) -> Bools:
        radii_squared = np.take(self._half_balls.radii_squared, members)
        reached = self._sums(NEAR, rows) <= radii_squared
        reached &= self._sums(HEIGHT, rows) >= 0.0
        result = self._sums(NEAR_HEIGHT, rows) >= 0.0
        result |= self._sums(FAR, rows) <= radii_squared
        result &= reached
        doubtful = np.flatnonzero(reached & ~result)
        bits, pairs = np.divmod(doubtful, len(members))
        offsets = np.stack((bits % SIDE, bits // SIDE % SIDE, bits // SIDE**2))
        cells = np.minimum(SIDE * np.take(places, pairs, axis=1) + offsets, self._edges.shape[1] - 2)
        half_balls = self._half_balls.take(members[pairs])
        low, high = (
            np.stack([np.take(faces, along + end) for faces, along in zip(self._edges, cells, strict=True)])
            - half_balls.centres
            for end in (0, 1)
        )
        result.reshape(-1)[doubtful] = plane_overlaps(half_balls, low, high)
        return result

    def _sums(self, term: int, rows: Ints) -> Floats:
        x, y, z = (np.take(terms[term], rows[axis], axis=1) for axis, terms in enumerate(self._terms))
        return cell_sums(x, y, z)


def axis_terms(half_balls: HalfBalls, edges: Float32, axis: int, firsts: Ints, counts: Ints) -> Floats:
    """(4 terms, SIDE, e) of the cells along an axis of counts[i] blocks from firsts[i] on, of each half ball in turn.

    Cells beyond the grid are taken as the last one, which leaves the bounds as they are.
    """
    cells = SIDE * expand(firsts, counts) + np.arange(SIDE)[:, None]
    cells = np.minimum(cells, edges.shape[1] - 2)
    centres, normals = (np.repeat(values[axis], counts) for values in (half_balls.centres, half_balls.normals))
    low, high = edges[axis][cells] - centres, edges[axis][cells + 1] - centres
    near, far = np.maximum(low, np.minimum(high, 0.0)), np.maximum(-low, high)
    return np.stack((near * near, far * far, np.maximum(normals * low, normals * high), normals * near))


def cell_sums(x: Floats, y: Floats, z: Floats) -> Floats:
    """(SIDE along z, y, x, m) sums of (SIDE, m) terms along the axes, added as `overlaps` does."""
    return np.asarray((x[None, None] + y[None, :, None]) + z[:, None, None])


def _axis_bounds(terms: Floats) -> Floats:
    """(6, e) least and greatest terms of each block's cells."""
    least, most = terms.min(axis=1), terms.max(axis=1)
    return np.stack((least[NEAR], most[NEAR], most[FAR], least[HEIGHT], most[HEIGHT], least[NEAR_HEIGHT]))


def cells_along(cells_per_axis: int) -> list[Masks]:
    """Per axis (b,) factors, of which the product is the bits of the cells that a block has."""
    counts = np.minimum(cells_per_axis - np.arange(0, cells_per_axis, SIDE), SIDE)
    by_count = [[sum(1 << step * i for i in range(count)) for count in counts] for step in (1, SIDE, SIDE**2)]
    return [np.array(values, np.uint64) for values in by_count]


def packed(reached: Bools) -> Masks:
    """(m,) masks of the (CELLS, m) or (SIDE along z, y, x, m) cells that are reached."""
    bits = reached.view(np.uint8).reshape(8, 8, -1)
    result = bits[:, 7].copy()
    for k in range(6, -1, -1):
        result += result
        result |= bits[:, k]
    return np.ascontiguousarray(result.T).view("<u8")[:, 0]


def unpacked(masks: Masks) -> Bools:
    """(CELLS, m) whether each bit of (m,) masks is set."""
    by_mask = np.unpackbits(masks.astype("<u8").view(np.uint8).reshape(-1, 8), axis=1, bitorder="little")
    return np.ascontiguousarray(by_mask.T).view(np.bool_)
