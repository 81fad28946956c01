# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking the light grid of a scene on arrays, and judging it at random points of the surface. Needs no Blender."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .core.light_grid import RANGE, TOLERANCE, GridSettings, LightGrid, nominal_radiosity
from .core.light_grid_error import GridError, grid_error
from .core.light_mesh import VirtualLightMesh, empty_light_mesh
from .core.light_scale import PROBES
from .core.progress import Progress, silent
from .core.range_grid import RangeGrid
from .core.scene import Finding, SceneSnapshot
from .core.surface_points import random_surface_points
from .core.validate import check_light_mesh

SUBJECT = "light grid"
# Pairs of a point and a light that the full sum may take: some seconds on one core.
_PAIRS = 2_000_000
_FEWEST_POINTS, _MOST_POINTS = 50, 1000


@dataclass(frozen=True)
class GridBake:
    """A light grid. seconds: it took to build. error: at random points of the visible surface under even light."""

    grid: LightGrid
    seconds: float
    error: GridError

    def report(self) -> dict[str, Any]:
        """The bake as JSON-able values."""
        return {
            "settings": asdict(self.grid.settings),
            "bytes": self.grid.nbytes,
            "milliseconds": 1000.0 * self.seconds,
            "occupancy": self.grid.occupancy,
            "points": len(self.error.point_errors),
            "point_error": self.error.percentiles(),
            **self._dropped(),
        }

    def _dropped(self) -> dict[str, Any]:
        """What range mode leaves out."""
        if self.grid.settings.mode != RANGE:
            return {}
        return {
            "share_lost": self.error.share_lost,
            "share_out_of_range": self.error.share_out_of_range,
            "share_overflowed": self.error.share_overflowed,
            "dropped_lights": self.dropped_lights(),
        }

    def dropped_lights(self) -> list[int]:
        """Lights that some cell leaves out for want of room, ascending."""
        grids = [part for _, part in self.grid.structures if isinstance(part, RangeGrid)]
        return sorted(int(light) for grid in grids for light in grid.occupancy.dropped_lights)

    def summary(self) -> str:
        """One line for the terminal."""
        settings, errors = self.grid.settings, self.error.percentiles()
        asked = {TOLERANCE: f"tolerance {settings.tolerance:g}", RANGE: f"range {settings.range:g}"}[settings.mode]
        seen = ", ".join(f"{name} {error:.2%}" for name, error in errors.items())
        return (
            f"light grid, {asked}: {1e-6 * self.grid.nbytes:.2f} MB in {self.seconds:.2f} s; point error under even "
            f"light: {seen}"
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Where the grid does not do what its settings say."""
        settings, errors = self.grid.settings, self.error.percentiles()
        found = []
        if settings.mode == TOLERANCE and errors["95 %"] > settings.tolerance:
            seen = f"{errors['95 %']:.1%} or more at 5 % of the points"
            problem = f"its irradiance is off by {seen}, the tolerance is {settings.tolerance:.1%}"
            found.append(Finding(SUBJECT, problem, "set a smaller tolerance, or sum all lights"))
        if self.grid.overflow:
            problem = f"{self.grid.overflow}; {self.error.share_overflowed:.1%} of the irradiance is lost with them"
            found.append(Finding(SUBJECT, problem, "allow more lights in a cell, or use a smaller range or more cells"))
        return tuple(found)


def bake_light_grid(
    snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, settings: GridSettings, progress: Progress = silent
) -> GridBake:
    """The grid over all that is visible, as if every light received 1 W/m². Raises InvalidInput, Cancelled."""
    start = time.perf_counter()
    probes = random_surface_points(snapshot.meshes, PROBES)
    grid = LightGrid.bake(light_mesh, snapshot.bounds(), settings, progress, probes)
    seconds = time.perf_counter() - start
    count = int(np.clip(_PAIRS // max(len(light_mesh), 1), _FEWEST_POINTS, _MOST_POINTS))
    points = random_surface_points(snapshot.meshes, count, seed=1)
    error = grid_error(grid, light_mesh, nominal_radiosity(light_mesh), points)
    return GridBake(grid, seconds, error)


def check_lights(
    snapshot: SceneSnapshot,
    light_mesh: VirtualLightMesh | None,
    settings: GridSettings | None,
    progress: Progress = silent,
) -> tuple[Finding, ...]:
    """What is wrong with a scene's light mesh, and where its light grid does not do what `settings` say.

    settings: None where all lights are summed. Raises InvalidInput, Cancelled.
    """
    findings = check_light_mesh(light_mesh if light_mesh is not None else empty_light_mesh(), snapshot.meshes)
    if not light_mesh or settings is None:
        return findings
    return (*findings, *bake_light_grid(snapshot, light_mesh, settings, progress).findings)
