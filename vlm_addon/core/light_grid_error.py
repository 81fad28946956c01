# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the irradiance that a light grid gives is from the sum over all lights, at points of surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .form_factor import polygon_form_factor
from .grid_frame import OUTSIDE
from .light_cut import cut_irradiance
from .light_grid import LightGrid, LitTree, usable_radiosity
from .light_links import leaves_out
from .light_mesh import VirtualLightMesh
from .metrics import point_error
from .range_grid import RangeGrid
from .scene import Float64
from .surface_points import SurfacePoints

Bools = npt.NDArray[np.bool_]

_PERCENTILES = {"median": 50.0, "95 %": 95.0, "99.9 %": 99.9}
_PAIRS_PER_BLOCK = 1 << 20


@dataclass(frozen=True)
class GridError:
    """Irradiance of points, (p, 3) float64 in W/m² each, without the lights that leave the points' tags out.

    full: from all lights. found: what the grid gives. in_range: in range mode, from the lights that reach the point's
    cell, whether or not its list has room; in the other mode the same as `found`.
    """

    full: Float64
    found: Float64
    in_range: Float64

    @property
    def point_errors(self) -> Float64:
        """(p,) `point_error` of the channels' sum."""
        return point_error(self.found.sum(axis=1), self.full.sum(axis=1))

    def percentiles(self) -> dict[str, float]:
        """Percentiles of the point errors by name; 0 without points."""
        return _percentiles(self.point_errors)

    def expected_percentiles(self, expected: Float64) -> dict[str, float]:
        """Those of the point errors that an estimate for the same points says, (p,) W/m², sum over the channels."""
        full = self.full.sum(axis=1)
        return _percentiles(point_error(full + expected, full))

    @property
    def share_lost(self) -> float:
        """Share of all points' irradiance that is missing, all channels together."""
        return self._share(self.full - self.found)

    @property
    def share_out_of_range(self) -> float:
        """Part of `share_lost` that comes from lights beyond their range."""
        return self._share(self.full - self.in_range)

    @property
    def share_overflowed(self) -> float:
        """Part of `share_lost` that comes from lights that did not fit into a cell's list."""
        return self._share(self.in_range - self.found)

    def _share(self, part: Float64) -> float:
        total = float(self.full.sum())
        return float(part.sum()) / total if total > 0.0 else 0.0


def _percentiles(errors: Float64) -> dict[str, float]:
    return {name: float(np.percentile(errors, at)) if len(errors) else 0.0 for name, at in _PERCENTILES.items()}


def grid_error(
    grid: LightGrid, light_mesh: VirtualLightMesh, radiosity: npt.ArrayLike, points: SurfacePoints
) -> GridError:
    """The error of `grid`, relit, at `points`. radiosity: (n, 3), W/m², of each light.

    Evaluates every light at every point in float64: some 100 to 1,000 points say enough about a large light mesh.
    Raises InvalidInput where the grid is not of these lights or the radiosity does not fit.
    """
    grid.require_made_of(light_mesh)
    radiosity = usable_radiosity(light_mesh, radiosity)
    full, found, in_range = (np.zeros((len(points.positions), 3)) for _ in range(3))
    grids = [part for _, part in grid.structures if isinstance(part, RangeGrid)]
    listed = grid.candidates(points.positions) if grids else None
    for block in _blocks(len(points.positions), len(light_mesh)):
        positions, tags = points.positions[block], points.tag_ids[block]
        factors = polygon_form_factor(positions, points.normals[block], light_mesh.corners)
        factors[leaves_out(light_mesh.links, light_mesh.tag_ids, tags[:, None])] = 0.0
        full[block] = factors @ radiosity
        if listed is not None:
            kept = np.zeros(factors.shape, bool)
            for row, point in enumerate(range(block.start, block.stop)):
                kept[row, listed.light_ids[listed.light_offsets[point] : listed.light_offsets[point + 1]]] = True
            found[block] = (factors * kept) @ radiosity
            in_range[block] = (factors * (kept | _reaching(grids, positions, len(light_mesh)))) @ radiosity
    for _, part in grid.relit(light_mesh, radiosity).structures:
        if isinstance(part, LitTree):
            found += cut_irradiance(
                part.tree, part.clusters, light_mesh, radiosity, points.positions, points.normals, points.tag_ids
            ).irradiance
    return GridError(full, found, found if listed is None else in_range)


def _reaching(grids: list[RangeGrid], positions: Float64, light_count: int) -> Bools:
    """(p, n) whether each light reaches the cell of each point; nothing for points outside."""
    result = np.zeros((len(positions), light_count), bool)
    for grid in grids:
        cells = grid.frame.cells(positions)
        for row in np.flatnonzero(cells != OUTSIDE):
            result[row] |= grid.reaching(int(cells[row]))
    return result


def _blocks(points: int, lights: int) -> Iterator[slice]:
    rows = max(1, _PAIRS_PER_BLOCK // max(1, lights))
    for start in range(0, points, rows):
        yield slice(start, min(start + rows, points))
