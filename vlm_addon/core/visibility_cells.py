# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of a scene, and the zones of each: parts of its air that nothing solid cuts apart.

What is known at the surfaces of a cell is looked up between cells, and light must not leak through a wall that way: two
rooms whose wall stands in one cell have surfaces in that cell both. So a cell's free voxels are joined where they share
faces, and what is joined is a zone. A block is the cube between the middles of eight cells: where zones of those cells
touch each other within the block, what is known of one counts for all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .octree_march import cells_at
from .scene import Float64, Int32

Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

SIDE = 8
"""Voxels along each edge of a cell."""
VOXELS = SIDE**3
UNKNOWN = -1
"""Zone of an occupied voxel; start of the labels of a cell that has none, because all of it is free."""
MOST_ZONES = 255
"""Of one cell, so that a label is a byte; further ones are taken to be the last."""
CORNERS = 8
"""Cells of a block, and blocks that a cell is in: x + 2 y + 4 z with 1 for the upper one along an axis."""

_ZONE_BITS = 31
_BITS = np.array([(corner & 1, corner >> 1 & 1, corner >> 2 & 1) for corner in range(CORNERS)], np.int64)


@dataclass(frozen=True)
class VisibilityCells:
    """per_axis: n, cells along each axis, one of them outside of the voxels at either end; cell (x, y, z) is number
    (n x + y) n + z. first_zone: (n³ + 1,) int32, where the zones of each cell begin. label_start: (n³,) int32, row of
    `labels`, or UNKNOWN where the whole cell is one zone. labels: (k, VOXELS) uint8, by voxel (SIDE x + y) SIDE + z of
    the cell: 0 where it is occupied, else 1 + its zone's number in the cell. component: (zones, CORNERS) int32, for
    each of the blocks that a zone is in, corner 1 the upper block, which zones it touches there: those with the same
    number. block_count: (n + 1)³; block (x, y, z), of the cells below and above its corner, is number
    ((n + 1) x + y) (n + 1) + z. component_count: of different numbers."""

    per_axis: int
    first_zone: Int32
    label_start: Int32
    labels: npt.NDArray[np.uint8]
    component: Int32
    component_count: int

    @property
    def zone_count(self) -> int:
        """Of all cells."""
        return len(self.component)

    @property
    def block_count(self) -> int:
        """Blocks, those on the outside included."""
        return (self.per_axis + 1) ** 3

    def zones_at(self, places: Float64) -> Int64:
        """(p,) the zone that holds each of (p, 3) places in voxel coordinates, UNKNOWN where its voxel is occupied."""
        voxels = cells_at(places) + SIDE
        inside = np.clip(voxels, 0, SIDE * self.per_axis - 1)
        cells = self.cell_numbers(inside // SIDE)
        start = self.label_start[cells]
        within = inside % SIDE @ np.array([SIDE * SIDE, SIDE, 1])
        labels = self.labels[np.maximum(start, 0), within].astype(np.int64) if len(self.labels) else np.ones_like(cells)
        labels = np.where(start == UNKNOWN, 1, labels)
        return np.asarray(np.where(labels > 0, self.first_zone[cells] + labels - 1, UNKNOWN))

    def cell_numbers(self, cells: Int64) -> Int64:
        """(p,) numbers of (p, 3) cells."""
        return np.asarray(cells @ np.array([self.per_axis**2, self.per_axis, 1]))

    def block_numbers(self, blocks: Int64) -> Int64:
        """(p,) numbers of (p, 3) blocks."""
        side = self.per_axis + 1
        return np.asarray(blocks @ np.array([side * side, side, 1]))

    def zone_cells(self) -> Int64:
        """(zones, 3) the cell of each zone."""
        numbers = np.repeat(np.arange(len(self.label_start)), np.diff(self.first_zone))
        return np.stack(np.unravel_index(numbers, (self.per_axis,) * 3), axis=1)


def make_cells(voxels: Int64, resolution: int) -> VisibilityCells:
    """The cells of a cube of `resolution` voxels along each axis, a multiple of SIDE; voxels: (v, 3) occupied ones."""
    per_axis = resolution // SIDE + 2
    occupied = np.zeros((per_axis * SIDE,) * 3, bool)
    occupied[tuple((voxels + SIDE).T)] = True
    by_cell = occupied.reshape(per_axis, SIDE, per_axis, SIDE, per_axis, SIDE).transpose(0, 2, 4, 1, 3, 5)
    by_cell = by_cell.reshape(per_axis**3, SIDE, SIDE, SIDE)
    busy = np.flatnonzero(by_cell.any(axis=(1, 2, 3)))
    labels = _labels(~by_cell[busy])
    counts = np.ones(per_axis**3, np.int64)
    counts[busy] = labels.reshape(len(busy), VOXELS).max(axis=1, initial=0)
    first_zone = np.concatenate([[0], np.cumsum(counts)])
    label_start = np.full(per_axis**3, UNKNOWN, np.int32)
    label_start[busy] = np.arange(len(busy))
    zones = np.broadcast_to(first_zone[:-1, None, None, None], by_cell.shape).copy()
    zones[busy] = np.where(labels > 0, zones[busy] + labels - 1, UNKNOWN)
    component = _components(_links(zones.reshape(per_axis, per_axis, per_axis, SIDE, SIDE, SIDE)), int(first_zone[-1]))
    return VisibilityCells(
        per_axis=per_axis,
        first_zone=first_zone.astype(np.int32),
        label_start=label_start,
        labels=labels.reshape(len(busy), VOXELS).astype(np.uint8),
        component=component.reshape(-1, CORNERS).astype(np.int32),
        component_count=int(component.max(initial=-1)) + 1,
    )


def _labels(free: Bools) -> Int64:
    """(k, SIDE, SIDE, SIDE): 0 where a cell is not free, else 1 + the number of its part of the cell."""
    own = np.arange(1, VOXELS + 1, dtype=np.int16).reshape(1, SIDE, SIDE, SIDE)
    labels = np.where(free, own, 0).astype(np.int16)
    going = np.arange(len(free))
    while len(going):
        before = labels[going]
        after = before.copy()
        for axis in (1, 2, 3):
            low, high = (slice(None),) * axis + (slice(0, -1),), (slice(None),) * axis + (slice(1, None),)
            np.maximum(after[low], after[high], out=after[low], where=free[going][low])
            np.maximum(after[high], after[low], out=after[high], where=free[going][high])
        labels[going] = after
        going = going[(after != before).any(axis=(1, 2, 3))]
    flat = labels.reshape(len(free), VOXELS)
    is_root = flat == own.reshape(1, VOXELS)
    rank = np.minimum(is_root.cumsum(axis=1), MOST_ZONES)
    padded = np.concatenate([np.zeros((len(free), 1), rank.dtype), rank], axis=1)
    numbered = np.take_along_axis(padded, flat.astype(np.int64), axis=1)
    return np.asarray(numbered.reshape(free.shape), np.int64)


def _links(zones: Int64) -> list[Int64]:
    """For each axis, (k, 2) zones of neighbouring cells whose free voxels share faces; lower cell first."""
    links = []
    for axis in range(3):
        below, above = [slice(None)] * 6, [slice(None)] * 6
        below[axis], above[axis] = slice(0, -1), slice(1, None)
        below[axis + 3], above[axis + 3] = SIDE - 1, 0  # type: ignore[call-overload]
        lower, upper = zones[tuple(below)].ravel(), zones[tuple(above)].ravel()
        free = (lower != UNKNOWN) & (upper != UNKNOWN)
        pairs = np.unique(lower[free] << _ZONE_BITS | upper[free])
        links.append(np.stack([pairs >> _ZONE_BITS, pairs & ((1 << _ZONE_BITS) - 1)], axis=1))
    return links


def _components(links: list[Int64], zone_count: int) -> Int64:
    """(zones CORNERS,) as VisibilityCells.component: two zones share the blocks on the face between their cells."""
    firsts, seconds = [], []
    for axis, pairs in enumerate(links):
        for corner in np.flatnonzero(_BITS[:, axis] == 1).tolist():
            firsts.append(pairs[:, 0] * CORNERS + corner)
            seconds.append(pairs[:, 1] * CORNERS + (corner ^ 1 << axis))
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    number = np.arange(zone_count * CORNERS)
    while True:
        least = np.minimum(number[first], number[second])
        found = number.copy()
        np.minimum.at(found, number[first], least)
        np.minimum.at(found, number[second], least)
        found = found[found]
        if (found == number).all():
            return np.asarray(np.unique(found, return_inverse=True)[1], np.int64)
        number = found


def corner_bits(corner: npt.NDArray[np.integer]) -> Int64:
    """(..., 3) 0 or 1 along each axis."""
    return np.asarray(_BITS[corner])
