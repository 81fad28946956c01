# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lights reach which cells of a grid: per block of 4 x 4 x 4 cells its lights, each with the cells it reaches.

Neighbouring cells share most of their lights, so this takes some 0.2 bytes for an entry of a cell's list. Built from
the side of the lights: per light the blocks of its half ball's bounding box, per block one integer (`block_masks`).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import Bools, HalfBalls
from .block_masks import CELLS, SIDE, BlockTests, Masks, block_edges, cells_along, expand, unpacked
from .errors import InvalidInput
from .progress import Progress, silent, step
from .scene import Float32

MAX_CELLS_PER_AXIS = 256
"""A slab of blocks has at most 4,096, so that numpy sorts their indices by radix."""

# Bounding boxes are widened by this share of the lengths that they are computed from: some ten roundings.
_SLACK = 1e-6
# Blocks and lights that are looked at at once.
_PAIRS_AT_ONCE = 1 << 14
THREADS = 2
# What eight counters of a byte each, side by side in one integer, hold.
_BYTE = 255
_LOWEST_BITS = np.uint64(0x0101010101010101)

Ints = npt.NDArray[Any]


@dataclass(frozen=True)
class BlockLists:
    """Lights of block b: light_ids[offsets[b] : offsets[b + 1]], ascending; masks: the cells that each reaches.

    offsets: (blocks + 1,) uint32. light_ids: (p,) uint32. masks: (p,) uint64, never 0. Blocks and the cells of the grid
    count along x first, then y, then z; bit x + 4 y + 16 z of a mask stands for the block's cell x, y, z.
    """

    cells_per_axis: int
    offsets: npt.NDArray[np.uint32]
    light_ids: npt.NDArray[np.uint32]
    masks: Masks

    @property
    def blocks_per_axis(self) -> int:
        """Blocks along each axis; the last may hold less than SIDE cells."""
        return -(-self.cells_per_axis // SIDE)

    @property
    def block_counts(self) -> Ints:
        """(blocks,) int64: the lights of each block."""
        return np.diff(self.offsets.astype(np.int64))

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.offsets.nbytes + self.light_ids.nbytes + self.masks.nbytes

    def places(self, cells: Ints) -> tuple[Ints, npt.NDArray[np.uint64]]:
        """Block of each cell, and its bit's number there."""
        n, b = self.cells_per_axis, self.blocks_per_axis
        x, y, z = cells % n, cells // n % n, cells // n**2
        bits = x % SIDE + SIDE * (y % SIDE) + SIDE**2 * (z % SIDE)
        return (z // SIDE * b + y // SIDE) * b + x // SIDE, bits.astype(np.uint64)

    def block_place(self, block: int) -> Ints:
        """(3,) place of a block along the axes."""
        b = self.blocks_per_axis
        return np.array([block % b, block // b % b, block // b**2])

    def all_cells(self) -> Masks:
        """(blocks,) masks of all cells that each block has."""
        x, y, z = cells_along(self.cells_per_axis)
        return (z[:, None, None] * y[:, None] * x).reshape(-1)

    def with_masks(self, masks: Masks) -> BlockLists:
        """These lists with other masks, without the pairs whose mask is 0."""
        kept = np.flatnonzero(masks)
        blocks = np.repeat(np.arange(len(self.block_counts)), self.block_counts)[kept]
        counts = np.bincount(blocks, minlength=len(self.block_counts))
        return lists_from_pairs(self.cells_per_axis, counts, self.light_ids[kept], masks[kept])

    def cells_of(self, block: int) -> tuple[Ints, Ints]:
        """Cells of a block and the number of each one's bit, by bit."""
        n, bits = self.cells_per_axis, np.arange(CELLS)
        offsets = np.stack((bits % SIDE, bits // SIDE % SIDE, bits // SIDE**2))
        x, y, z = SIDE * self.block_place(block)[:, None] + offsets
        inside = (x < n) & (y < n) & (z < n)
        return ((z * n + y) * n + x)[inside], bits[inside]

    def cell_counts(self) -> npt.NDArray[np.uint32]:
        """(cells,): the lights of each cell."""
        return self.cells_from_bits(self.bit_counts())

    def cells_from_bits(self, values: Ints) -> Ints:
        """(cells,) values of cells that are given as (blocks, CELLS), by bit."""
        n, b = self.cells_per_axis, self.blocks_per_axis
        by_place = values.reshape(b, b, b, SIDE, SIDE, SIDE).transpose(0, 3, 1, 4, 2, 5)
        return np.ascontiguousarray(by_place.reshape((b * SIDE,) * 3)[:n, :n, :n]).reshape(-1)

    def bit_counts(self) -> npt.NDArray[np.uint32]:
        """(blocks, CELLS): how many masks of each block have each bit. Bytes count eight bits at a time, to 255."""
        result = np.zeros((self.blocks_per_axis**3, CELLS), np.uint32)
        filled = np.flatnonzero(self.block_counts)
        if not len(filled):
            return result
        starts, runs = self.offsets[filled].astype(np.int64), -(-self.block_counts[filled] // _BYTE)
        rows = np.repeat(starts, runs) + _BYTE * expand(np.zeros_like(runs), runs)
        for shift in range(8):
            ones = (self.masks >> np.uint64(shift)) & _LOWEST_BITS
            counts = np.add.reduceat(ones, rows).astype("<u8").view(np.uint8).reshape(-1, 8)
            result[filled, shift::8] = np.add.reduceat(counts, np.cumsum(runs) - runs, axis=0, dtype=np.uint32)
        return result

    def cell_lists(self, cells: npt.ArrayLike) -> tuple[Ints, npt.NDArray[np.uint32]]:
        """Offsets (m + 1,) int64 and light ids: those of cells[i] are ids[offsets[i] : offsets[i + 1]], ascending."""
        blocks, bits = self.places(np.asarray(cells, np.int64))
        counts, kept_counts = self.block_counts[blocks], np.zeros(len(blocks), np.int64)
        parts = [np.zeros(0, np.uint32)]
        for run in runs_of_about(counts, _PAIRS_AT_ONCE):
            rows = expand(self.offsets[blocks[run]].astype(np.int64), counts[run])
            owners = np.repeat(np.arange(run.stop - run.start), counts[run])
            kept = np.flatnonzero((self.masks[rows] >> bits[run][owners]) & np.uint64(1))
            parts.append(self.light_ids[rows[kept]])
            kept_counts[run] = np.bincount(owners[kept], minlength=run.stop - run.start)
        return np.concatenate(([0], np.cumsum(kept_counts))), np.concatenate(parts)

    def fixed_size(self, width: int, empty: int) -> npt.NDArray[np.uint32]:
        """(cells, width) uint32 lists of all cells, none of them longer than `width`; empty slots hold `empty`."""
        result = np.full((self.cells_per_axis**3, width), empty, np.uint32)
        for block in np.flatnonzero(self.block_counts):
            lights = self.light_ids[self.offsets[block] : self.offsets[block + 1]]
            cells, bits = self.cells_of(block)
            owners, rows = np.nonzero(self.reached(block)[bits])
            counts = np.bincount(owners, minlength=len(cells))
            slots = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
            result[cells[owners], slots] = lights[rows]
        return result

    def reached(self, block: int) -> Bools:
        """(CELLS, m) whether each of a block's lights reaches each of its cells, by bit."""
        return unpacked(self.masks[self.offsets[block] : self.offsets[block + 1]])


def runs_of_about(counts: Ints, total: int) -> Iterator[slice]:
    """Runs of rows whose `counts` add up to some `total`, or of one row; all rows together."""
    group = np.cumsum(counts) // total
    bounds = [0, *(np.flatnonzero(np.diff(group)) + 1).tolist(), len(counts)]
    yield from (slice(start, end) for start, end in itertools.pairwise(bounds) if start < end)


def lists_from_pairs(cells_per_axis: int, counts: Ints, light_ids: Ints, masks: Masks) -> BlockLists:
    """The lists of (blocks,) lengths, with lights and masks one after the other. Raises InvalidInput for too many."""
    offsets = np.zeros(len(counts) + 1, np.uint64)
    np.cumsum(counts, out=offsets[1:])
    if offsets[-1] >= 2**32:
        raise InvalidInput("light grid", f"it has {offsets[-1]:,} lists' entries", "use a smaller grid or range")
    return BlockLists(cells_per_axis, offsets.astype(np.uint32), light_ids.astype(np.uint32, copy=False), masks)


def build_block_lists(half_balls: HalfBalls, edges: Float32, progress: Progress = silent) -> BlockLists:
    """The lights whose half ball overlaps each closed cell.

    edges: (3, n + 1) float32, ascending: the cells' faces along each axis, in the frame of the half balls (float32),
    n <= MAX_CELLS_PER_AXIS. Raises Cancelled, InvalidInput for lists of 2^32 pairs.
    """
    slab_lights = _lights_of_slabs(half_balls, edges)
    parts = []
    with ThreadPoolExecutor(THREADS) as pool:
        tasks = [pool.submit(_slab, half_balls, edges, k, lights) for k, lights in enumerate(slab_lights)]
        try:
            for k, task in enumerate(tasks):
                parts.append(task.result())
                step(progress, (k + 1) / len(tasks), "light grid")
        finally:
            for task in tasks:
                task.cancel()
    counts, light_ids, masks = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return lists_from_pairs(edges.shape[1] - 1, counts, light_ids, masks)


def _lights_of_slabs(half_balls: HalfBalls, edges: Float32) -> list[Ints]:
    """For each slab of blocks along z, the lights that may reach it, ascending."""
    faces = block_edges(edges)
    first, last = _axis_range(half_balls, faces, 2)
    counts = np.maximum(last - first + 1, 0)
    slabs = expand(first, counts).astype(np.uint16)
    lights = np.repeat(np.arange(len(half_balls)), counts)[np.argsort(slabs, kind="stable")]
    ends = np.cumsum(np.bincount(slabs, minlength=faces.shape[1] - 1))
    return np.split(lights, ends[:-1])


def _axis_range(half_balls: HalfBalls, faces: Float32, axis: int) -> tuple[Ints, Ints]:
    """(n,) first and last block along an axis that the bounding box of each half ball touches; last < first: none."""
    centres = half_balls.centres[axis].astype(np.float64)
    normals = half_balls.normals[axis].astype(np.float64)
    radii = np.sqrt(np.maximum(half_balls.radii_squared, 0.0).astype(np.float64))
    slack = _SLACK * (np.abs(centres) + radii)
    # On the dark side the half ball ends where its flat disc does.
    up = radii * np.sqrt(np.maximum(1.0 + _SLACK - np.minimum(normals, 0.0) ** 2, 0.0))
    down = radii * np.sqrt(np.maximum(1.0 + _SLACK - np.maximum(normals, 0.0) ** 2, 0.0))
    low, high = (centres - down - slack).astype(np.float32), (centres + up + slack).astype(np.float32)
    first = np.maximum(np.searchsorted(faces[axis], low, "left") - 1, 0)
    last = np.minimum(np.searchsorted(faces[axis], high, "right") - 1, faces.shape[1] - 2)
    return first, np.where(half_balls.radii_squared < 0.0, -1, last)


def _slab(half_balls: HalfBalls, edges: Float32, k: int, lights: Ints) -> tuple[Ints, npt.NDArray[np.uint32], Masks]:
    """Lengths of the lists of slab k's blocks, and their lights and masks."""
    faces = block_edges(edges)
    per_axis = faces.shape[1] - 1
    chosen = half_balls.take(lights)
    ranges = [_axis_range(chosen, faces, axis) for axis in (0, 1)] + [(np.full(len(lights), k),) * 2]
    firsts = np.stack([first for first, _ in ranges])
    counts = np.stack([np.maximum(last - first + 1, 0) for first, last in ranges])
    tests = BlockTests(chosen, edges, firsts, counts)
    blocks, owners, masks = [np.zeros(0, np.uint16)], [np.zeros(0, np.uint32)], [np.zeros(0, np.uint64)]
    pairs = counts.prod(axis=0)
    for run in runs_of_about(pairs, _PAIRS_AT_ONCE):
        members = np.repeat(np.arange(run.start, run.stop), pairs[run])
        y, x = np.divmod(expand(np.zeros_like(pairs[run]), pairs[run]), counts[0, members])
        found = tests.masks(members, np.stack((x, y, np.zeros_like(x))))
        kept = np.flatnonzero(found)
        members = members[kept]
        blocks.append(((firsts[1, members] + y[kept]) * per_axis + firsts[0, members] + x[kept]).astype(np.uint16))
        owners.append(lights[members].astype(np.uint32))
        masks.append(found[kept])
    all_blocks = np.concatenate(blocks)
    order = np.argsort(all_blocks, kind="stable")
    lengths = np.bincount(all_blocks, minlength=per_axis**2)
    return lengths, np.concatenate(owners)[order], np.concatenate(masks)[order]
