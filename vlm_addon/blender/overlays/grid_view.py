# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid that the scene asks for, made for the overlay alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ...core.errors import InvalidInput
from ...core.grid_samples import GridView, grid_view
from ...core.light_grid import LightGrid
from ...core.light_scale import PROBES
from ...core.progress import Progress
from ...core.surface_points import random_surface_points
from ..extraction.light_mesh_io import extract
from ..light_grid_options import scene_grid_settings
from . import overlays

SceneView = tuple[GridView, str]


def from_scene(context: Any) -> Callable[[Progress], SceneView]:
    """Work that makes the grid of the scene's lights, with the scene's name. Raises InvalidInput."""
    settings = scene_grid_settings(context.scene)
    subject = f"scene {context.scene.name!r}"
    if settings is None:
        problem = "it sums all lights, without a light grid"
        raise InvalidInput(subject, problem, "choose Tolerance or Range for Lights (Render)")
    found = extract()
    if found.light_mesh is None:
        raise InvalidInput(subject, "it has no virtual lights", "create some, or show them in this view layer")
    snapshot, light_mesh, name = found.snapshot, found.light_mesh, context.scene.name
    bounds = snapshot.bounds() if snapshot.triangle_count else (light_mesh.vertices.min(0), light_mesh.vertices.max(0))

    def work(progress: Progress) -> SceneView:
        probes = random_surface_points(snapshot.meshes, PROBES)
        grid = LightGrid.bake(light_mesh, bounds, settings, progress, probes)
        return grid_view(grid, light_mesh, bounds), name

    return work


def show(context: Any, made: SceneView) -> str:
    """Show it in the 3D views; returns a sentence. Raises InvalidInput."""
    view, name = made
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise InvalidInput(f"scene {name!r}", "it is gone", "show the light grid again")
    overlays.show_grid(context, scene, view)
    per_axis = view.frame.cells_per_axis
    return f"Showing a light grid of {view.grid.light_count:,} lights, {per_axis} x {per_axis} x {per_axis} cells"
