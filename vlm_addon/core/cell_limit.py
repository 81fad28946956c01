# SPDX-License-Identifier: GPL-3.0-or-later
"""A greatest length for the lists of a grid's cells, and what is left out for it (seed 002, 4.1)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import COORDINATE_STEP, Bools, HalfBalls
from .block_lists import THREADS, BlockLists
from .block_masks import CELLS, SIDE, cell_sums, packed
from .progress import Progress, silent, step
from .scene import Float32, Float64

Ints = npt.NDArray[Any]

_BLOCKS_PER_TASK = 64
# Stands for the squared distance 0: of coordinates' rounding.
_LEAST_SQUARED = np.float32(COORDINATE_STEP**2)


@dataclass(frozen=True)
class Occupancy:
    """How full the cells are, and what did not fit.

    cells, entries: of the whole grid, entries without those left out. fullest: lights that reach the cell that most
    lights reach. overflowing_cells: (m,) uint32, those with more lights than fit. dropped_entries: pairs of a cell
    and a light left out. cells_dropped_from: (lights,) uint32, how many cells leave each light out.
    """

    cells: int
    entries: int
    fullest: int
    overflowing_cells: npt.NDArray[np.uint32]
    dropped_entries: int
    cells_dropped_from: npt.NDArray[np.uint32]

    @property
    def dropped_lights(self) -> npt.NDArray[Any]:
        """(m,) int64: lights that some cell leaves out though they reach it, ascending."""
        return np.flatnonzero(self.cells_dropped_from)

    def summary(self) -> str:
        """One line for reports."""
        mean = self.entries / self.cells
        text = f"{self.cells:,} cells, {mean:.1f} lights in the mean, {self.fullest:,} lights reach the fullest"
        if not self.dropped_entries:
            return f"{text}, nothing dropped"
        share = self.dropped_entries / (self.entries + self.dropped_entries)
        return (
            f"{text}, {len(self.overflowing_cells):,} cells overflow, {share:.1%} of all entries dropped,"
            f" of {len(self.dropped_lights):,} lights"
        )


def limited(
    lists: BlockLists,
    half_balls: HalfBalls,
    edges: Float32,
    areas: Float64,
    max_lights: int,
    progress: Progress = silent,
) -> tuple[BlockLists, Occupancy]:
    """`lists` with at most `max_lights` lights a cell (0: any number), and what that leaves out.

    A full cell keeps the lights of the greatest `disc_form_factors` in it, of equal ones those of lower id.
    areas: (n,) of each light, in the grid's frame. Raises Cancelled.
    """
    bit_counts = lists.bit_counts()
    counts = lists.cells_from_bits(bit_counts)
    overflowing = np.flatnonzero(counts > max_lights) if max_lights else np.zeros(0, np.int64)
    dropped = np.zeros(len(half_balls), np.uint32)
    if len(overflowing):
        masks, lost = lists.masks.copy(), np.zeros(len(lists.masks), np.uint8)

        def trim(blocks: Ints) -> None:
            for block in blocks:
                rows = slice(int(lists.offsets[block]), int(lists.offsets[block + 1]))
                lights, reached = lists.light_ids[rows], lists.reached(block)
                place = lists.block_place(block)
                worth = disc_form_factors(half_balls.take(lights), areas[lights], edges, place)
                kept = _kept(reached, bit_counts[block], worth, max_lights)
                masks[rows], lost[rows] = packed(kept), (reached & ~kept).sum(axis=0)

        _in_parallel(trim, np.unique(lists.places(overflowing)[0]), progress)
        dropped = np.bincount(lists.light_ids, lost, len(half_balls)).astype(np.uint32)
        lists = lists.with_masks(masks)
    reached_entries, dropped_entries = int(counts.sum(dtype=np.int64)), int(dropped.sum(dtype=np.int64))
    return lists, Occupancy(
        cells=len(counts),
        entries=reached_entries - dropped_entries,
        fullest=int(counts.max(initial=0)),
        overflowing_cells=overflowing.astype(np.uint32),
        dropped_entries=dropped_entries,
        cells_dropped_from=dropped,
    )


def _in_parallel(work: Callable[[Ints], None], blocks: Ints, progress: Progress) -> None:
    tasks = np.array_split(blocks, -(-len(blocks) // _BLOCKS_PER_TASK))
    with ThreadPoolExecutor(THREADS) as pool:
        running = [pool.submit(work, some) for some in tasks]
        try:
            for k, task in enumerate(running):
                task.result()
                step(progress, (k + 1) / len(running), "full cells")
        finally:
            for task in running:
                task.cancel()


def disc_form_factors(half_balls: HalfBalls, areas: Float64, edges: Float32, place: Ints) -> Float32:
    """(CELLS, m) float32: about the greatest form factor of each light at a point of each of a block's cells.

    Of a disc of the light's area A, seen by what faces it: A cos' / (pi d² + A) with the least distance d of its centre
    from the cell and cos' <= h / d for the greatest height h of the cell over its plane; exact over the disc's middle.
    half_balls, areas: of m lights, in the grid's frame. place: (3,) of the block along the axes.
    """
    cells = np.minimum(SIDE * place[:, None] + np.arange(SIDE), edges.shape[1] - 2)
    near_terms, height_terms = [], []
    for faces, along, centre, normal in zip(edges, cells, half_balls.centres, half_balls.normals, strict=True):
        low, high = faces[along][:, None] - centre, faces[along + 1][:, None] - centre
        near_terms.append(np.square(np.maximum(low, np.minimum(high, 0.0))))
        height_terms.append(np.maximum(normal * low, normal * high))
    squared = np.maximum(cell_sums(*near_terms).reshape(CELLS, -1), _LEAST_SQUARED)
    heights = cell_sums(*height_terms).reshape(CELLS, -1)
    shares = (areas / np.pi).astype(np.float32)
    cosines = np.clip(heights / np.sqrt(squared), 0.0, 1.0)
    return np.asarray(shares * cosines / (squared + shares))


def _kept(reached: Bools, counts: Ints, worth: Float32, most: int) -> Bools:
    """(CELLS, m) what stays of `reached` where at most `most` lights of a cell do: the best, of equal ones the first.

    counts: (CELLS,) lights that reach each cell. worth: (CELLS, m), not negative.
    """
    full = np.flatnonzero(counts > most)
    ranks = np.where(reached[full], worth[full], np.float32(-1.0))
    last = ranks.shape[1] - most
    ordered = np.partition(ranks, last, axis=1)
    least = ordered[:, last, None]
    kept = ranks >= least
    crowded = np.flatnonzero((ordered[:, :last] == least).any(axis=1))
    above, equal = ranks[crowded] > least[crowded], ranks[crowded] == least[crowded]
    kept[crowded] = above | (equal & (above.sum(axis=1)[:, None] + np.cumsum(equal, axis=1) <= most))
    result = reached.copy()
    result[full] = kept
    return result
