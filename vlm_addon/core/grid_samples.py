# SPDX-License-Identifier: GPL-3.0-or-later
"""A light grid cell by cell, for display: how many lights count in a cell, and how far its light may be off.

In range mode cells are those of the grid. With a tolerance there are none, so space is cut into equal boxes and the
middle of each is looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .grid_frame import Bounds, GridFrame, make_frame
from .light_grid import RANGE, LightGrid, LitTree
from .light_mesh import VirtualLightMesh
from .light_scale import mean_irradiance
from .range_grid import RangeGrid
from .scene import Float64

Int64 = npt.NDArray[np.int64]

BOXES_PER_AXIS = 24
"""Boxes along each axis where the grid has no cells of its own."""


@dataclass(frozen=True)
class GridView:
    """A grid to be looked at. mean_irradiance: W/m², what errors are told as shares of; 0 in range mode."""

    grid: LightGrid
    frame: GridFrame
    mean_irradiance: float


@dataclass(frozen=True)
class Cells:
    """corners: (c, 2, 3) lower and upper corner, m. counts: (c,) lights and clusters that count in each.

    errors: (c,) how far irradiance may be off, as a share of the mean of the surfaces; None where that is not known.
    """

    corners: Float64
    counts: Int64
    errors: Float64 | None


def grid_view(grid: LightGrid, light_mesh: VirtualLightMesh, bounds: Bounds) -> GridView:
    """grid: of `light_mesh`, lit by its nominal radiosity. bounds: of the visible scene."""
    own = [part.frame for _, part in grid.structures if isinstance(part, RangeGrid)]
    if grid.settings.mode == RANGE:
        return GridView(grid, own[0] if own else make_frame(bounds, grid.settings.grid), 0.0)
    trees = [part.tree for _, part in grid.structures if isinstance(part, LitTree)]
    mean = mean_irradiance(trees, light_mesh, light_mesh.nominal_radiosity, grid.probes)
    return GridView(grid, make_frame(bounds, BOXES_PER_AXIS), mean)


def slice_cells(frame: GridFrame, axis: int, place: float) -> Int64:
    """(c, 3) cells of one layer across an axis, the nearest to `place` in m along it."""
    per_axis = frame.cells_per_axis
    layer = _nearest(frame, axis, place)
    across = np.stack(np.meshgrid(np.arange(per_axis), np.arange(per_axis), indexing="ij"), axis=-1).reshape(-1, 2)
    return np.insert(across, axis, layer, axis=1)


def cells_around(frame: GridFrame, point: npt.ArrayLike, reach: int) -> Int64:
    """(c, 3) cells at most `reach` away along each axis from the one that is nearest to a point, m."""
    middle = np.array([_nearest(frame, axis, place) for axis, place in enumerate(np.asarray(point, np.float64))])
    steps = np.arange(-reach, reach + 1)
    cells = middle + np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(cells[((cells >= 0) & (cells < frame.cells_per_axis)).all(axis=1)])


def look(view: GridView, cells: Int64) -> Cells:
    """What the grid says of (c, 3) cells of its frame, at their middles."""
    frame = view.frame
    low = np.stack([frame.edges[axis, cells[:, axis]] for axis in range(3)], axis=1).astype(np.float64)
    high = np.stack([frame.edges[axis, cells[:, axis] + 1] for axis in range(3)], axis=1).astype(np.float64)
    corners = np.stack([low, high], axis=1) * frame.unit + frame.middle
    middles = corners.mean(axis=1)
    found = view.grid.candidates(middles)
    counts = np.diff(found.light_offsets) + np.diff(found.cluster_offsets)
    if view.grid.settings.mode == RANGE or not view.mean_irradiance > 0.0:
        return Cells(corners, counts, None)
    return Cells(corners, counts, view.grid.expected_error(middles) / view.mean_irradiance)


def _nearest(frame: GridFrame, axis: int, place: float) -> int:
    local = (place - frame.middle[axis]) / frame.unit
    found = np.searchsorted(frame.edges[axis], local, "right") - 1
    return int(np.clip(found, 0, frame.cells_per_axis - 1))
