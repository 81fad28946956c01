# SPDX-License-Identifier: GPL-3.0-or-later
"""A greatest length for the lists of a grid's cells, and what is left out for it (seed 002, 4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import COORDINATE_STEP, Bools, Floats, HalfBalls
from .block_lists import THREADS, BlockLists
from .block_masks import CELLS, SIDE, Masks, cell_sums, packed, unpacked
from .progress import Progress, silent, step
from .scene import Float32, Float64

Ints = npt.NDArray[Any]

_BLOCKS_PER_TASK = 64
# Stands for the squared distance 0: of coordinates' rounding.
_LEAST_SQUARED = np.float32(COORDINATE_STEP**2)
_BITS_OF_BYTE = np.array([byte.bit_count() for byte in range(256)], np.uint8)


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


def overflow_text(occupancies: Sequence[Occupancy], max_lights: int) -> str:
    """How many cells of grids have more lights than fit, and how many lights they leave out; "" if none does."""
    cells = sum(len(occupancy.overflowing_cells) for occupancy in occupancies)
    if not cells:
        return ""
    lights = sum(len(occupancy.dropped_lights) for occupancy in occupancies)
    dropped = sum(occupancy.dropped_entries for occupancy in occupancies)
    share = dropped / (dropped + sum(occupancy.entries for occupancy in occupancies))
    return (
        f"{cells:,} cells have more than {max_lights:,} lights; {lights:,} lights are left out of some, {dropped:,} or"
        f" {share:.1%} of all entries"
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

    A full cell keeps the lights of the greatest form factors (`BlockDiscs`) in it, of equal ones those of lower id.
    areas: (n,) of each light, in the grid's frame. Raises Cancelled.
    """
    bit_counts = lists.bit_counts()
    counts = lists.cells_from_bits(bit_counts)
    overflowing = np.flatnonzero(counts > max_lights) if max_lights else np.zeros(0, np.int64)
    dropped = np.zeros(len(half_balls), np.uint32)
    if len(overflowing):
        masks, all_cells = lists.masks.copy(), lists.all_cells()

        def trim(blocks: Ints) -> None:
            for block in blocks:
                rows = slice(int(lists.offsets[block]), int(lists.offsets[block + 1]))
                lights = lists.light_ids[rows]
                discs = BlockDiscs(half_balls.take(lights), areas[lights], edges, lists.block_place(block))
                some = discs.ever_among(max_lights, lists.masks[rows] == all_cells[block])
                reached, counts = unpacked(lists.masks[rows][some]), bit_counts[block]
                kept = np.zeros(len(lights), np.uint64)
                kept[some] = packed(_kept(reached, counts, discs.form_factors(some), max_lights))
                masks[rows] = kept

        _in_parallel(trim, np.unique(lists.places(overflowing)[0]), progress)
        dropped = np.bincount(lists.light_ids, _bits_set(lists.masks ^ masks), len(half_balls)).astype(np.uint32)
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


class BlockDiscs:
    """About the greatest form factor of each of m lights at a point of each of a block's cells.

    Of a disc of the light's area A, seen by what faces it: A cos' / (pi d² + A) with the least distance d of its centre
    from the cell and cos' <= h / d for the greatest height h of the cell over its plane; exact over the disc's middle.
    """

    def __init__(self, half_balls: HalfBalls, areas: Float64, edges: Float32, place: Ints) -> None:
        """half_balls, areas: of the lights, in the grid's frame. place: (3,) of the block along the axes."""
        cells = np.minimum(SIDE * place[:, None] + np.arange(SIDE), edges.shape[1] - 2)
        low, high = (np.take_along_axis(edges, cells + end, axis=1)[:, :, None] for end in (0, 1))
        centres, normals = half_balls.centres[:, None], half_balls.normals[:, None]
        low, high = low - centres, high - centres
        self._squared = np.square(np.maximum(low, np.minimum(high, 0.0)))
        self._heights = np.maximum(normals * low, normals * high)
        self._shares = (areas / np.pi).astype(np.float32)

    def form_factors(self, some: Ints) -> Float32:
        """(CELLS, k) float32, of the lights of these k rows."""
        squared, heights = (
            cell_sums(*np.take(terms, some, axis=2)).reshape(CELLS, -1) for terms in (self._squared, self._heights)
        )
        return self._of(squared, heights, self._shares[some])

    def ever_among(self, most: int, whole: Bools) -> Ints:
        """Rows of the lights that can be among the `most` best of any cell; whole: (m,) those that reach all cells.

        Rounding is monotonic, so the terms' bounds over the block bound the form factors in its cells.
        """
        if whole.sum() < most:
            return np.arange(len(whole))
        nearest, highest = (_total(reduce(axis=1)) for reduce in (self._squared.min, self._heights.max))
        farthest, lowest = (_total(reduce(axis=1)) for reduce in (self._squared.max, self._heights.min))
        least = self._of(farthest, lowest, self._shares)[whole]
        enough = np.partition(least, len(least) - most)[len(least) - most]
        return np.flatnonzero(self._of(nearest, highest, self._shares) >= enough)

    @staticmethod
    def _of(squared: Floats, heights: Floats, shares: Floats) -> Float32:
        squared = np.maximum(squared, _LEAST_SQUARED)
        cosines = np.clip(heights / np.sqrt(squared), 0.0, 1.0)
        return np.asarray(shares * cosines / (squared + shares))


def _total(terms: Floats) -> Floats:
    return np.asarray((terms[0] + terms[1]) + terms[2])


def _bits_set(masks: Masks) -> npt.NDArray[np.uint8]:
    """(m,) how many bits of each mask are set."""
    return _BITS_OF_BYTE[masks.view(np.uint8)].reshape(-1, 8).sum(axis=1, dtype=np.uint8)


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
