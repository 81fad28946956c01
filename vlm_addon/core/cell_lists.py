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
_COLUMN_ROUNDING = np.float32(1e-4)
# More than any place in the frame.
_BEYOND = np.float32(2.0**100)
# Runs of cells in a row that are looked at at once: they and their cells stay in a core's cache.
_RUNS_PER_BAND = 1 << 14
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
    parts = []
    for first_row, end_row in _bands(first_rows, last_rows, per_axis):
        starts = np.maximum(first_rows, first_row)
        row_counts = np.minimum(last_rows, end_row - 1) - starts + 1
        members = np.flatnonzero(row_counts > 0)
        band_balls = chosen.take(members)
        runs = _runs(band_balls, edges, k, starts[members], row_counts[members])
        cells, cell_lights = _pairs(band_balls, edges, k, runs, lights[members])
        cells -= first_row * per_axis
        cell_count = (end_row - first_row) * per_axis
        order = np.argsort(cells.astype(np.uint8) if cell_count <= 256 else cells, kind="stable")
        parts.append((np.bincount(cells, minlength=cell_count), cell_lights[order]))
    counts, light_ids = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return counts, light_ids


def _bands(first_rows: Ints, last_rows: Ints, row_count: int) -> list[tuple[int, int]]:
    """First row and end of bands of rows that hold some _RUNS_PER_BAND runs each, all rows of a slab together."""
    reached = first_rows <= last_rows
    changes = np.bincount(first_rows[reached], minlength=row_count + 1)
    changes -= np.bincount(last_rows[reached] + 1, minlength=row_count + 1)
    runs_before = np.cumsum(np.cumsum(changes[:row_count])) // _RUNS_PER_BAND
    starts = [0, *(np.flatnonzero(np.diff(runs_before)) + 1).tolist()]
    return list(zip(starts, [*starts[1:], row_count], strict=True))


def _pairs(
    half_balls: HalfBalls, edges: Float32, k: int, runs: _Runs, lights: Ints
) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.uint32]]:
    """Cells of slab k and the lights that reach them, by light: every pair once."""
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
    """The runs of slab k, by light; row_counts rows of each light from first_rows on are looked at.

    A run may be reached where ball and row, and half space and row, overlap. It is reached for certain where a cell's
    near point is in both. Both sets are parts of the row; `slack` is subtracted from the one and added to the other.
    """
    (cx, cy, cz), (nx, ny, nz) = half_balls.centres, half_balls.normals
    low_z, high_z = edges[2, k] - cz, edges[2, k + 1] - cz
    near_z = np.maximum(low_z, np.minimum(high_z, 0.0))
    slack_z = _SLACK * (np.abs(cx) + np.maximum(-low_z, high_z))
    lift_z, near_lift_z = np.maximum(nz * low_z, nz * high_z), nz * near_z
    spread = _SLACK * half_balls.radii_squared
    room_z = half_balls.radii_squared - near_z * near_z
    rises, falls = nx > _LEAST_SLOPE, nx < -_LEAST_SLOPE
    slope = np.abs(nx)
    # Where the plane crosses the row at a height of `lift`: -lift * inverse, or beyond the row's ends.
    inverse = half_balls.inverse_normals[0]
    rising, falling = inverse * rises, inverse * falls
    low_end, high_end = -_BEYOND * ~rises, _BEYOND * ~falls

    def spread_out(*per_light: Floats) -> list[Floats]:
        return [np.repeat(values, row_counts) for values in per_light]

    cx, cy, ny, slack, lift, near_lift, spread, room, slope, rising, falling, low_end, high_end = spread_out(
        cx, cy, ny, slack_z, lift_z, near_lift_z, spread, room_z, slope, rising, falling, low_end, high_end
    )
    rows = expand(first_rows, row_counts)
    low_y, high_y = edges[1][rows] - cy, edges[1][rows + 1] - cy
    near_y = np.maximum(low_y, np.minimum(high_y, 0.0))
    room = room - near_y * near_y
    reach = np.sqrt(np.maximum(room + spread, 0.0))
    slack = slack + _SLACK * (np.maximum(-low_y, high_y) + reach)
    lift = lift + np.maximum(ny * low_y, ny * high_y) + slack
    columns = _Columns(edges[0])
    low, high = np.maximum(low_end - lift * rising, -reach), np.minimum(high_end - lift * falling, reach)
    first = np.maximum(columns.of(cx + low - slack, -1.0), 0)
    last = np.minimum(columns.of(cx + high + slack, 1.0), columns.count - 1)
    reached = (room + spread >= 0.0) & (lift + slope * reach >= 0.0) & (low <= high + slack) & (first <= last)

    near_lift = near_lift + ny * near_y - slack
    sure_reach = np.sqrt(np.maximum(room - spread, 0.0)) - slack
    low_crossing, high_crossing = low_end - near_lift * rising, high_end - near_lift * falling
    low, high = np.maximum(low_crossing, -sure_reach), np.minimum(high_crossing, sure_reach)
    # A cell's near point is its end towards the centre, which must be on the lit side of the crossing.
    sure_first = columns.of(cx + low + slack, 1.0) + (low_crossing > 0.0)
    sure_last = columns.of(cx + high - slack, -1.0) - (high_crossing < 0.0)
    sure_first, sure_last = np.maximum(sure_first, first), np.minimum(sure_last, last)
    sure = (slope > _LEAST_SLOPE) | (near_lift >= slope * reach)
    sure &= (room > spread) & (high - low > 2.0 * (slack + columns.doubt)) & (sure_first <= sure_last)
    sure_first = np.minimum(np.maximum(sure_first, (last + 1) * ~sure), last + 1)
    sure_last = np.maximum(sure_last, last * ~sure)

    kept = np.flatnonzero(reached)
    lights = np.repeat(np.arange(len(half_balls)), row_counts)
    return _Runs(*(np.take(values, kept) for values in (lights, rows, first, last, sure_first, sure_last)))


class _Columns:
    """Cells of about one width along an axis, found without a search."""

    def __init__(self, edges: Float32) -> None:
        self.count = len(edges) - 1
        self._start = edges[0]
        self._per_unit = np.float32(self.count) / (edges[-1] - edges[0])
        places = (edges - self._start) * self._per_unit
        self._doubt_in_cells = np.abs(places - np.arange(len(edges), dtype=np.float32)).max() + _COLUMN_ROUNDING
        self.doubt = self._doubt_in_cells / self._per_unit
        """How far, in the frame, a place may be from where it seems to be among the cells."""

    def of(self, places: Floats, towards: float) -> Ints:
        """int32 cell of each place, rounded up (towards 1) or down (-1) in doubt; -1 and `count` beyond the ends."""
        cells = (places - self._start) * self._per_unit + np.float32(towards) * self._doubt_in_cells
        return np.floor(np.clip(cells, -1.0, self.count)).astype(np.int32)
