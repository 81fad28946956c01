# SPDX-License-Identifier: GPL-3.0-or-later
"""A greatest length for the lists of a grid's cells, and what is left out for it (seed 002, 4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import HalfBalls
from .cell_lists import CellLists, expand, lists_from_counts
from .errors import InvalidInput
from .scene import Float32, Float64

Ints = npt.NDArray[Any]

_ENTRIES_PER_BLOCK = 1 << 18
# A sort key of 64 bits holds which cell of a block (11 bits), a float32 and a place in the cell's list.
_CELLS_PER_BLOCK = 1 << 11
_RANK_BITS = 21


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
    lists: CellLists, half_balls: HalfBalls, edges: Float32, areas: Float64, radii: Float64, max_lights: int
) -> tuple[CellLists, Occupancy]:
    """`lists` with at most `max_lights` lights a cell (0: any number), and what that leaves out.

    A full cell keeps the lights of the greatest bound on their form factor in it, the lower id where bounds are
    equal as float32. areas, radii: (n,) area and bounding radius of each light, in the grid's frame.
    Raises InvalidInput where more lights reach one cell than can be ranked, some two million.
    """
    counts = lists.counts
    fullest = int(counts.max(initial=0))
    if max_lights and fullest >= 1 << _RANK_BITS:
        raise InvalidInput(
            "light grid", f"{fullest:,} lights reach one cell", "use a shorter range or no greatest list"
        )
    overflowing = np.flatnonzero(counts > max_lights) if max_lights else np.zeros(0, np.int64)
    dropped = np.zeros(len(half_balls), np.uint32)
    keep = np.ones(len(lists.light_ids), bool) if len(overflowing) else np.zeros(0, bool)
    for cells in _blocks(overflowing, counts):
        starts = lists.offsets[cells].astype(np.int64)
        positions = expand(starts, counts[cells])
        lights = lists.light_ids[positions]
        owners = np.repeat(np.arange(len(cells)), counts[cells])
        bounds = form_factor_bounds(half_balls.take(lights), areas[lights], radii[lights], edges, cells[owners])
        late_owners, late_ranks = _surplus(owners, positions - starts[owners], bounds, counts[cells], max_lights)
        surplus = starts[late_owners] + late_ranks
        keep[surplus] = False
        dropped += np.bincount(lists.light_ids[surplus], minlength=len(half_balls)).astype(np.uint32)
    if len(overflowing):
        lists = lists_from_counts(np.minimum(counts, max_lights), lists.light_ids[keep])
    total = int(counts.sum())
    entries = len(lists.light_ids)
    return lists, Occupancy(len(counts), entries, fullest, overflowing.astype(np.uint32), total - entries, dropped)


def form_factor_bounds(
    half_balls: HalfBalls, areas: Float64, radii: Float64, edges: Float32, cells: npt.NDArray[Any]
) -> Float64:
    """(m,) float64: no point of cell i gets more than this share of the radiosity of light i as irradiance.

    With rho the light's bounding radius, d the least distance from its centre to the cell and h the greatest height
    of the cell over its plane: 1, rho² / d² (of its bounding ball) and A cos' / (pi (d - rho)²), cos' <= h / (d - rho).
    """
    per_axis = edges.shape[1] - 1
    indices = np.stack((cells % per_axis, cells // per_axis % per_axis, cells // per_axis**2))
    axes = np.arange(3)[:, None]
    low = edges[axes, indices].astype(np.float64) - half_balls.centres
    high = edges[axes, indices + 1].astype(np.float64) - half_balls.centres
    distances = np.linalg.norm(np.maximum(low, np.minimum(high, 0.0)), axis=0)
    heights = np.maximum(half_balls.normals * low, half_balls.normals * high).sum(axis=0)
    outside = distances > radii
    gaps = np.where(outside, distances - radii, 1.0)
    by_ball = (radii / np.where(outside, distances, 1.0)) ** 2
    by_area = areas * np.clip(heights / gaps, 0.0, 1.0) / (np.pi * gaps * gaps)
    return np.where(outside, np.minimum(np.minimum(by_ball, by_area), 1.0), 1.0)


def _surplus(owners: Ints, ranks: Ints, bounds: Float64, counts: Ints, max_lights: int) -> tuple[Ints, Ints]:
    """Owner and rank by id of the entries that do not fit.

    One sort of one integer for each entry: owner, then falling bound (the bits of a positive float rise with it), then
    rank.
    """
    falling = ~bounds.astype(np.float32).view(np.uint32)
    keys = owners.astype(np.uint64) << np.uint64(_RANK_BITS + 32)
    keys |= falling.astype(np.uint64) << np.uint64(_RANK_BITS)
    keys |= ranks.astype(np.uint64)
    keys.sort()
    place = np.arange(len(keys)) - np.repeat(np.cumsum(counts) - counts, counts)
    late = place >= max_lights
    return owners[late], (keys[late] & np.uint64((1 << _RANK_BITS) - 1)).astype(np.int64)


def _blocks(cells: Ints, counts: Ints) -> list[Ints]:
    """`cells` in groups of some _ENTRIES_PER_BLOCK entries and at most _CELLS_PER_BLOCK cells."""
    if not len(cells):
        return []
    by_entries = np.cumsum(counts[cells]) // _ENTRIES_PER_BLOCK
    by_cells = np.arange(len(cells)) // _CELLS_PER_BLOCK
    return np.split(cells, np.flatnonzero((np.diff(by_entries) > 0) | (np.diff(by_cells) > 0)) + 1)
