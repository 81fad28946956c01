# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that a grid leaves out at points of surfaces, against the sum over all lights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import overlaps
from .errors import InvalidInput
from .form_factor import polygon_form_factor
from .light_grid import OUTSIDE, LightGrid
from .light_mesh import VirtualLightMesh
from .scene import Float64

_PAIRS_PER_BLOCK = 1 << 20


@dataclass(frozen=True)
class LostIrradiance:
    """Irradiance of points, (p, 3) float64 in W/m² each.

    full: from all lights. in_range: from the lights that reach the point's cell. kept: from those that the cell also
    has room for.
    """

    full: Float64
    in_range: Float64
    kept: Float64

    @property
    def share(self) -> float:
        """Share of all points' irradiance that is lost, 0 to 1, all channels together."""
        return _share(self.full - self.kept, self.full)

    @property
    def share_out_of_range(self) -> float:
        """Part of `share` that comes from lights beyond their range."""
        return _share(self.full - self.in_range, self.full)

    @property
    def share_overflowed(self) -> float:
        """Part of `share` that comes from lights that did not fit into a cell's list."""
        return _share(self.in_range - self.kept, self.full)

    @property
    def point_shares(self) -> Float64:
        """(p,) share lost at each point; 0 where no light arrives."""
        full = self.full.sum(axis=1)
        return np.where(full > 0.0, 1.0 - self.kept.sum(axis=1) / np.where(full > 0.0, full, 1.0), 0.0)


def lost_irradiance(
    grid: LightGrid,
    light_mesh: VirtualLightMesh,
    radiosity: npt.ArrayLike,
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
) -> LostIrradiance:
    """What `grid` loses at (p, 3) points of surfaces with unit normals. radiosity: (n, 3), W/m², of each light.

    Evaluates every light at every point in float64: some 100 to 1,000 points say enough about a large light mesh. Own
    tags are not left out. Raises InvalidInput where the grid is not of these lights or an array does not fit.
    """
    grid.require_made_of(light_mesh)
    points, normals = np.asarray(points, np.float64), np.asarray(normals, np.float64)
    radiosity = np.asarray(radiosity, np.float64)
    if radiosity.shape != (len(light_mesh), 3):
        problem = f"shape {radiosity.shape} for {len(light_mesh)} lights"
        raise InvalidInput("radiosity of light grid", problem, "give one row of three per light")
    offsets, light_ids = grid.candidates(points)
    cells = grid.frame.cells(points)
    sums = [np.zeros((len(points), 3)) for _ in range(3)]
    rows = max(1, _PAIRS_PER_BLOCK // max(1, len(light_mesh)))
    for start in range(0, len(points), rows):
        block = slice(start, min(start + rows, len(points)))
        factors = polygon_form_factor(points[block], normals[block], light_mesh.corners)
        kept = np.zeros(factors.shape, bool)
        for row, point in enumerate(range(block.start, block.stop)):
            kept[row, light_ids[offsets[point] : offsets[point + 1]]] = True
        in_range = np.array(
            [kept[row] if cell == OUTSIDE else _reaching(grid, int(cell)) for row, cell in enumerate(cells[block])]
        )
        for total, chosen in zip(sums, (np.ones_like(kept), in_range, kept), strict=True):
            total[block] = (factors * chosen) @ radiosity
    return LostIrradiance(*sums)


def _reaching(grid: LightGrid, cell: int) -> npt.NDArray[np.bool_]:
    """(n,) whether each light reaches a cell, whether or not its list has room."""
    edges, per_axis = grid.frame.edges, grid.frame.cells_per_axis
    place = np.array([cell % per_axis, cell // per_axis % per_axis, cell // per_axis**2])
    axes = np.arange(3)
    return overlaps(grid.half_balls, edges[axes, place][:, None], edges[axes, place + 1][:, None])


def _share(part: npt.NDArray[Any], whole: npt.NDArray[Any]) -> float:
    total = float(whole.sum())
    return float(part.sum()) / total if total > 0.0 else 0.0
