# SPDX-License-Identifier: GPL-3.0-or-later
"""A greatest length for the lists of a grid's cells, and what is left out for it (seed 002, 4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import HalfBalls
from .cell_lists import CellLists, expand, lists_from_counts
from .scene import Float32, Float64

_ENTRIES_PER_BLOCK = 1 << 20


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
    equal. areas, radii: (n,) area and bounding radius of each light, in the grid's frame.
    """
    counts = lists.counts
    fullest = int(counts.max(initial=0))
    overflowing = np.flatnonzero(counts > max_lights) if max_lights else np.zeros(0, np.int64)
    dropped = np.zeros(len(half_balls), np.uint32)
    keep = np.ones(len(lists.light_ids), bool) if len(overflowing) else np.zeros(0, bool)
    for cells in _blocks(overflowing, counts):
        positions = expand(lists.offsets[cells].astype(np.int64), counts[cells])
        lights = lists.light_ids[positions]
        owners = np.repeat(np.arange(len(cells)), counts[cells])
        bounds = form_factor_bounds(half_balls.take(lights), areas[lights], radii[lights], edges, cells[owners])
        order = np.lexsort((lights, -bounds, owners))
        starts = np.cumsum(counts[cells]) - counts[cells]
        ranks = np.arange(len(order)) - starts[owners]
        surplus = order[ranks >= max_lights]
        keep[positions[surplus]] = False
        dropped += np.bincount(lights[surplus], minlength=len(half_balls)).astype(np.uint32)
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


def _blocks(cells: npt.NDArray[Any], counts: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
    """`cells` in groups of some _ENTRIES_PER_BLOCK entries."""
    groups = np.cumsum(counts[cells]) // _ENTRIES_PER_BLOCK
    return np.split(cells, np.flatnonzero(np.diff(groups)) + 1) if len(cells) else []
