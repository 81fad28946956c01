# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking the light grid of a scene on arrays, and judging it at random points of the surface. Needs no Blender."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .core.finding_kinds import BROKEN
from .core.light_grid import FEW_LIGHTS, RANGE, TOLERANCE, GridSettings, LightGrid
from .core.light_grid_error import GridError, grid_error
from .core.light_marks import LightHistory
from .core.light_mesh import VirtualLightMesh, empty_light_mesh
from .core.light_scale import PROBES
from .core.progress import Progress, as_report, part, silent
from .core.range_grid import RangeGrid
from .core.scene import Finding, Float64, SceneSnapshot
from .core.surface_points import random_surface_points
from .core.validate import check_light_mesh

SUBJECT = "light grid"
# Pairs of a point and a light that the full sum may take: some seconds on one core.
_PAIRS = 2_000_000
# Share of a check that is done when the light mesh is judged and its grid is yet to be.
LIGHT_MESH_TIME = 0.7
_FEWEST_POINTS, _MOST_POINTS = 50, 1000
NOTICEABLE_LOSS = GridSettings.tolerance
"""Share of the irradiance that a range may leave out unsaid: what the other mode may be off by if nothing is set."""


@dataclass(frozen=True)
class GridBake:
    """A light grid. seconds: it took to build. error: at random points of the visible surface under even light.

    expected: (p,) W/m², what the grid itself expects its error to be at those points; None in range mode.
    """

    grid: LightGrid
    seconds: float
    error: GridError
    expected: Float64 | None

    def report(self) -> dict[str, Any]:
        """The bake as JSON-able values."""
        return {
            "settings": asdict(self.grid.settings),
            "bytes": self.grid.nbytes,
            "milliseconds": 1000.0 * self.seconds,
            "occupancy": self.grid.occupancy,
            "points": len(self.error.point_errors),
            "point_error": self.error.percentiles(),
            "all_lights_summed": self.all_lights_summed,
            **self._expected(),
            **self._dropped(),
        }

    def _expected(self) -> dict[str, Any]:
        """Beside `point_error`, so that one sees whether the estimate can be trusted here."""
        if self.expected is None:
            return {}
        return {"expected_point_error": self.error.expected_percentiles(self.expected)}

    @property
    def all_lights_summed(self) -> bool:
        """Whether renderers sum all lights in place of its clusters, since there are so few."""
        return self.grid.settings.mode == TOLERANCE and self.grid.light_count <= FEW_LIGHTS

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
        unused = f"; renderers sum all of so few lights ({self.grid.light_count})" if self.all_lights_summed else ""
        return (
            f"light grid, {asked}: {1e-6 * self.grid.nbytes:.2f} MB in {self.seconds:.2f} s; point error under even "
            f"light: {seen}{unused}"
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Where the grid does not do what its settings say, and what a range leaves out."""
        return (*self._tolerance_findings(), *self._range_findings())

    def _tolerance_findings(self) -> list[Finding]:
        """Of so few lights that all are summed, none: renderers use no clusters."""
        tolerance, errors = self.grid.settings.tolerance, self.error.percentiles()
        if self.grid.settings.mode != TOLERANCE or self.all_lights_summed:
            return []
        seen = [
            f"{errors[name]:.1%} or more at {others} of the points, where {most:.1%} is allowed"
            for name, others, most in (("95 %", "5 %", tolerance), ("99.9 %", "0.1 %", 3.0 * tolerance))
            if errors[name] > most
        ]
        if not seen:
            return []
        problem = f"its irradiance is off by {' and by '.join(seen)} (tolerance {tolerance:.1%})"
        return [Finding(SUBJECT, problem, "set a smaller tolerance, or sum all lights")]

    def _range_findings(self) -> list[Finding]:
        found = []
        if self.grid.settings.mode == RANGE and self.error.share_out_of_range > NOTICEABLE_LOSS:
            share = f"{self.error.share_out_of_range:.1%} of the irradiance"
            problem = f"{share} comes from lights beyond their range of {self.grid.settings.range:g}"
            problem += " and is left out, which is the nature of range mode"
            found.append(Finding(SUBJECT, problem, "use a tolerance, which leaves nothing out, or a larger range"))
        if self.grid.overflow:
            problem = f"{self.grid.overflow}; {self.error.share_overflowed:.1%} of the irradiance is lost with them"
            found.append(Finding(SUBJECT, problem, "allow more lights in a cell, or use a smaller range or more cells"))
        return found


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
    error = grid_error(grid, light_mesh, light_mesh.nominal_radiosity, points)
    expected = grid.expected_error(points.positions) if settings.mode == TOLERANCE else None
    return GridBake(grid, seconds, error, expected)


def check_lights(
    snapshot: SceneSnapshot,
    light_mesh: VirtualLightMesh | None,
    settings: GridSettings | None,
    progress: Progress = silent,
    history: LightHistory | None = None,
) -> tuple[Finding, ...]:
    """What is wrong with a scene's light mesh, and where its light grid does not do what `settings` say.

    settings: None where all lights are summed. history: how the lights were made, where that is known. Raises
    InvalidInput, Cancelled.
    """
    checked = light_mesh if light_mesh is not None else empty_light_mesh()
    share = 1.0 if settings is None else LIGHT_MESH_TIME
    report = as_report(part(progress, 0.0, share), "light mesh")
    findings = check_light_mesh(checked, snapshot.meshes, report, history=history)
    if not light_mesh or settings is None or any(finding.kind in BROKEN for finding in findings):
        return findings
    return (*findings, *bake_light_grid(snapshot, light_mesh, settings, part(progress, share, 1.0)).findings)
