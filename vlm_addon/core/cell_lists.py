# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lights reach which cells of a grid: built from the side of the lights, stored without gaps.

Per light the cells of its half ball's bounding box, per row of cells those between the ends of the half ball: these
hold every cell that the half ball overlaps, and `overlaps` decides about each of them, as it would about all cells.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import Floats, HalfBalls, overlaps
from .progress import Progress, silent, step
from .scene import Float32

MAX_CELLS_PER_AXIS = 256
"""A slab of cells has at most 65,536, so that numpy sorts their indices by radix."""

# The outer bounds below are widened by this share of the lengths that they are computed from: some ten roundings.
_SLACK = 1e-6
# Under this component of the normal along a row, the plane does not bound the row.
_LEAST_SLOPE = 1e-3
# Of a place along an axis, in cells: some roundings at MAX_CELLS_PER_AXIS.
_COLUMN_ROUNDING = 1e-4
# Rows of cells that are looked at at once: their arrays stay in a core's cache.
_ROWS_PER_BLOCK = 1 << 15
_THREADS = 2

Ints = npt.NDArray[Any]


@dataclass(frozen=True)
class CellLists:
    """Lights of cell c: light_ids[offsets[c] : offsets[c + 1]], ascending.

    offsets: (cells + 1,) uint32, or uint64 from 2^32 entries on. light_ids: uint32. Cells count along x first, then y,
    then z.
    """

    offsets: Ints
    light_ids: npt.NDArray[np.uint32]

    @property
    def counts(self) -> Ints:
        """(cells,) int64: the lights of each cell."""
        return np.diff(self.offsets.astype(np.int64))

    @property
    def nbytes(self) -> int:
        """Bytes of both arrays."""
        return self.offsets.nbytes + self.light_ids.nbytes


def lists_from_counts(counts: Ints, light_ids: npt.NDArray[np.uint32]) -> CellLists:
    """The lists of (cells,) lengths, with the ids of all of them one after the other."""
    offsets = np.zeros(len(counts) + 1, np.uint64)
    np.cumsum(counts, out=offsets[1:])
    return CellLists(offsets.astype(np.uint32) if offsets[-1] < 2**32 else offsets, light_ids)


def gather(lists: CellLists, cells: Ints) -> CellLists:
    """The lists of `cells`, in that order."""
    starts, counts = lists.offsets[cells].astype(np.int64), lists.counts[cells]
    return lists_from_counts(counts, lists.light_ids[expand(starts, counts)])


def expand(starts: Ints, counts: Ints) -> Ints:
    """starts[0], starts[0] + 1, … counts[0] values, then the same from starts[1], and so on; int64."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) + np.repeat(starts - ends + counts, counts)


def build_cell_lists(half_balls: HalfBalls, edges: Float32, progress: Progress = silent) -> CellLists:
    """The lights whose half ball overlaps each closed cell.

    edges: (3, n + 1) float32, ascending: the cells' faces along each axis, in the frame of the half balls (float32),
    n <= MAX_CELLS_PER_AXIS. Raises Cancelled.
    """
    cells = edges.shape[1] - 1
    slab_lights = _lights_of_slabs(half_balls, edges)
    counts = np.zeros((cells, cells * cells), np.int64)
    parts: list[npt.NDArray[np.uint32]] = []
    with ThreadPoolExecutor(_THREADS) as pool:
        tasks = [pool.submit(_slab, half_balls, edges, k, lights) for k, lights in enumerate(slab_lights)]
        try:
            for k, task in enumerate(tasks):
                counts[k], light_ids = task.result()
                parts.append(light_ids)
                step(progress, (k + 1) / cells, "light grid")
        finally:
            for task in tasks:
                task.cancel()
    return lists_from_counts(counts.reshape(-1), np.concatenate(parts))


def _lights_of_slabs(half_balls: HalfBalls, edges: Float32) -> list[Ints]:
    """For each slab of cells along z, the lights that may reach it, ascending."""
    first, last = _axis_range(half_balls, edges, 2)
    counts = np.maximum(last - first + 1, 0)
    slabs = expand(first, counts).astype(np.uint16)
    lights = np.repeat(np.arange(len(half_balls)), counts)[np.argsort(slabs, kind="stable")]
    ends = np.cumsum(np.bincount(slabs, minlength=edges.shape[1] - 1))
    return np.split(lights, ends[:-1])


def _axis_range(half_balls: HalfBalls, edges: Float32, axis: int) -> tuple[Ints, Ints]:
    """(n,) first and last cell along an axis that the bounding box of each half ball touches; last < first: none."""
    centres = half_balls.centres[axis].astype(np.float64)
    normals = half_balls.normals[axis].astype(np.float64)
    radii = np.sqrt(np.maximum(half_balls.radii_squared, 0.0).astype(np.float64))
    slack = _SLACK * (np.abs(centres) + radii)
    # On the dark side the half ball ends where its flat disc does.
    up = radii * np.sqrt(np.maximum(1.0 + _SLACK - np.minimum(normals, 0.0) ** 2, 0.0))
    down = radii * np.sqrt(np.maximum(1.0 + _SLACK - np.maximum(normals, 0.0) ** 2, 0.0))
    first, last = _touched(edges[axis], centres - down - slack, centres + up + slack)
    return first, np.where(half_balls.radii_squared < 0.0, -1, last)


def _touched(edges: Float32, low: npt.NDArray[Any], high: npt.NDArray[Any]) -> tuple[Ints, Ints]:
    """First and last closed cell that the intervals from `low` to `high` touch; last < first: none."""
    first = np.searchsorted(edges, low.astype(edges.dtype), "left") - 1
    last = np.searchsorted(edges, high.astype(edges.dtype), "right") - 1
    return np.maximum(first, 0), np.minimum(last, len(edges) - 2)


@dataclass(frozen=True)
class _Runs:
    """Runs of cells in rows of one slab, one for each row that a light may reach.

    lights: which of the slab's lights, ascending. rows: along y. first, last: columns that may be reached. sure_first,
    sure_last: those of them that `overlaps` is certain to find reached; none where sure_last < sure_first.
    """

    lights: Ints
    rows: Ints
    first: Ints
    last: Ints
    sure_first: Ints
    sure_last: Ints


def _slab(half_balls: HalfBalls, edges: Float32, k: int, lights: Ints) -> tuple[Ints, npt.NDArray[np.uint32]]:
    """Lengths of the lists of slab k's cells, and the lists."""
    per_axis = edges.shape[1] - 1
    chosen = half_balls.take(lights)
    first_rows, last_rows = _axis_range(chosen, edges, 1)
    row_counts = np.maximum(last_rows - first_rows + 1, 0)
    groups = np.cumsum(row_counts) // _ROWS_PER_BLOCK
    blocks = np.split(np.arange(len(lights)), np.flatnonzero(np.diff(groups)) + 1)
    pairs = [
        _pairs(chosen.take(block), edges, k, first_rows[block], row_counts[block], lights[block]) for block in blocks
    ]
    cells, slab_lights = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    order = np.argsort(cells, kind="stable")
    return np.bincount(cells, minlength=per_axis * per_axis), slab_lights[order]


def _pairs(
    half_balls: HalfBalls, edges: Float32, k: int, first_rows: Ints, row_counts: Ints, lights: Ints
) -> tuple[Ints, npt.NDArray[np.uint32]]:
    """Cells of slab k and the lights that reach them, by light: every pair once."""
    runs = _runs(half_balls, edges, k, first_rows, row_counts)
    counts = runs.last - runs.first + 1
    starts = np.cumsum(counts) - counts
    cells = expand(runs.rows * (edges.shape[1] - 1) + runs.first, counts).astype(np.uint16)
    cell_lights = np.repeat(lights[runs.lights].astype(np.uint32), counts)

    before, after = runs.sure_first - runs.first, runs.last - runs.sure_last
    doubtful = np.concatenate((expand(starts, before), expand(starts + counts - after, after)))
    members = np.concatenate((np.repeat(runs.lights, before), np.repeat(runs.lights, after)))
    reached = _cells_overlap(half_balls.take(members), edges, k, cells[doubtful])
    keep = np.ones(len(cells), bool)
    keep[doubtful[~reached]] = False
    return cells[keep], cell_lights[keep]


def _cells_overlap(half_balls: HalfBalls, edges: Float32, k: int, cells: Ints) -> npt.NDArray[np.bool_]:
    """(m,) whether half ball i overlaps the cell of index cells[i] in slab k."""
    rows, columns = np.divmod(cells.astype(np.int32), edges.shape[1] - 1)
    layers = np.full_like(rows, k)
    low = np.stack((edges[0, columns], edges[1, rows], edges[2, layers]))
    high = np.stack((edges[0, columns + 1], edges[1, rows + 1], edges[2, layers + 1]))
    return overlaps(half_balls, low, high)


def _runs(half_balls: HalfBalls, edges: Float32, k: int, first_rows: Ints, row_counts: Ints) -> _Runs:
    """The runs of slab k, by light; row_counts rows of each light from first_rows on are looked at."""
    lights = np.repeat(np.arange(len(half_balls)), row_counts)
    rows = expand(first_rows, row_counts)
    (cx, cy, cz), (nx, ny, nz) = half_balls.centres[:, lights], half_balls.normals[:, lights]
    radii_squared = half_balls.radii_squared[lights]
    low_y, high_y, low_z, high_z = edges[1, rows] - cy, edges[1, rows + 1] - cy, edges[2, k] - cz, edges[2, k + 1] - cz
    near_y, near_z = (np.maximum(low, np.minimum(high, 0.0)) for low, high in ((low_y, high_y), (low_z, high_z)))
    across_squared = near_y * near_y + near_z * near_z

    room = radii_squared * (1.0 + _SLACK) - across_squared
    reach = np.sqrt(np.maximum(room, 0.0))
    slack = _SLACK * (np.abs(cx) + np.maximum(-low_y, high_y) + np.maximum(-low_z, high_z) + reach)
    # The most that y and z add to the height over the light's plane in this row.
    lift = np.maximum(ny * low_y, ny * high_y) + np.maximum(nz * low_z, nz * high_z) + slack
    low, high, _ = _lit_part(nx, lift, reach)
    columns = _Columns(edges[0])
    first, last = columns.of(cx + low - slack, -1.0), columns.of(cx + high + slack, 1.0)
    reached = (room >= 0.0) & (lift + np.abs(nx) * reach >= 0.0) & (low <= high + slack)
    first, last = np.maximum(first, 0), np.minimum(last, columns.count - 1)
    reached &= first <= last

    sure_room = radii_squared * (1.0 - _SLACK) - across_squared
    sure_reach = np.sqrt(np.maximum(sure_room, 0.0)) - slack
    near_lift = ny * near_y + nz * near_z - slack
    low, high, crossing = _lit_part(nx, near_lift, sure_reach)
    sure_first, sure_last = columns.of(cx + low + slack, 1.0), columns.of(cx + high - slack, -1.0)
    # A cell's near point is its end towards the centre, which must be on the lit side of the crossing.
    sure_first += (nx > _LEAST_SLOPE) & (crossing > 0.0)
    sure_last -= (nx < -_LEAST_SLOPE) & (crossing < 0.0)
    sure_first, sure_last = np.maximum(sure_first, first), np.minimum(sure_last, last)
    flat = (np.abs(nx) <= _LEAST_SLOPE) & (near_lift < np.abs(nx) * reach)
    narrow = high - low <= 2.0 * (slack + columns.doubt)
    unsure = flat | (sure_room <= 0.0) | narrow | (sure_first > sure_last)
    sure_first, sure_last = np.where(unsure, last + 1, sure_first), np.where(unsure, last, sure_last)
    return _Runs(*(values[reached] for values in (lights, rows, first, last, sure_first, sure_last)))


class _Columns:
    """Cells of about one width along an axis, found without a search."""

    def __init__(self, edges: Float32) -> None:
        self.count = len(edges) - 1
        self._start = edges[0]
        self._per_unit = self.count / (edges[-1] - edges[0])
        widths = np.linspace(0.0, self.count, len(edges))
        off = np.abs((edges - self._start) * self._per_unit - widths).max() + _COLUMN_ROUNDING
        self._doubt_in_cells = np.float32(off)
        self.doubt = np.float32(off / self._per_unit)
        """How far, in the frame, a place may be from where it seems to be among the cells."""

    def of(self, places: Floats, towards: float) -> Ints:
        """int32 cell of each place, rounded up (towards 1) or down (-1) in doubt; -1 and `count` beyond the ends."""
        cells = (places - self._start) * self._per_unit + towards * self._doubt_in_cells
        return np.floor(np.clip(cells, -1.0, self.count)).astype(np.int32)


def _lit_part(nx: Floats, lift: Floats, reach: Floats) -> tuple[Floats, Floats, Floats]:
    """Ends of the part of [-reach, reach] in which nx x + lift >= 0 unless nx is small, and the x where it is 0."""
    steep = np.abs(nx) > _LEAST_SLOPE
    crossing = -lift / np.where(steep, nx, 1.0)
    low = np.where(steep & (nx > 0.0), np.maximum(crossing, -reach), -reach)
    high = np.where(steep & (nx < 0.0), np.minimum(crossing, reach), reach)
    return low, high, crossing
