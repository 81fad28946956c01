# SPDX-License-Identifier: GPL-3.0-or-later
"""`bake --visibility`: what the scene's surfaces see of its lights, by the renderer's process."""

from __future__ import annotations

import time
from argparse import Namespace
from dataclasses import dataclass
from typing import Any

import bpy

from ...core.baked_visibility import BakedVisibility
from ...core.errors import InvalidInput
from ...core.light_grid_export import SUFFIX as FIXED_SIZE_SUFFIX
from ...core.scene import SceneSnapshot
from ...terminal import TerminalProgress
from ..extraction.extract import ExtractOptions
from ..extraction.light_mesh_io import extract_light_mesh
from ..interface.properties import technique_settings
from ..light_grid_options import TECHNIQUE
from ..render_process import KEPT


@dataclass(frozen=True)
class VisibilityBake:
    """seconds: it took, the start of the renderer included. asked_for: cells along the longest axis."""

    baked: BakedVisibility
    seconds: float
    asked_for: int

    def report(self) -> dict[str, Any]:
        """The bake as JSON-able values; ways: between points of surfaces and lights that were looked at."""
        return {
            "cells": self.baked.cells_per_axis,
            "cells_asked_for": self.asked_for,
            "points": self.baked.points,
            "rows": len(self.baked.shares),
            "bytes": self.baked.nbytes,
            "ways": self.baked.ways,
            "milliseconds": 1000.0 * self.seconds,
        }

    def summary(self) -> str:
        """For people, in a line."""
        cells = f"{self.baked.cells_per_axis} cells"
        if self.baked.cells_per_axis != self.asked_for:
            cells += f" in place of {self.asked_for}, which would take too much memory"
        rows, lights = self.baked.shares.shape
        return (
            f"visibility of {lights:,} lights from {rows:,} rows ({cells}): {1e-6 * self.baked.nbytes:.1f} MB, "
            f"{1e-6 * self.baked.ways:.1f} million ways in {self.seconds:.1f} s"
        )


def require_room_for_visibility(arguments: Namespace) -> None:
    """Raises InvalidInput where --visibility is asked for and the light grid's file cannot hold it."""
    file = arguments.light_grid
    if arguments.visibility and file is not None and file.suffix == FIXED_SIZE_SUFFIX:
        raise InvalidInput("--visibility", f"{file.name} holds lists alone", "give --light-grid another suffix")


def bake_visibility(snapshot: SceneSnapshot, viewport_levels: bool) -> VisibilityBake | None:
    """Of the scene's lights as they are stored, with the scene's settings; None where it has no lights.

    Raises VlmError, as Device.bake_visibility.
    """
    light_mesh = extract_light_mesh(snapshot, ExtractOptions(viewport_levels=viewport_levels))
    if light_mesh is None:
        return None
    values = technique_settings(bpy.context.scene, TECHNIQUE)
    cells, points = values["visibility_cells"], values["visibility_points"]
    start = time.perf_counter()
    try:
        baked = KEPT.bake_visibility(snapshot, light_mesh, cells, points, TerminalProgress())
    finally:
        KEPT.close()
    return VisibilityBake(baked, time.perf_counter() - start, cells)
