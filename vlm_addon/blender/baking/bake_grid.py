# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking the light grid that the scene asks for, beside the .blend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ...core.bake_key import BakeKey, grid_key
from ...core.baked_visibility import BakedVisibility
from ...core.counting import counted
from ...core.errors import InvalidInput
from ...core.progress import Progress
from ...light_grid_bake import GridBake, bake_light_grid
from ..extraction.light_mesh_io import extract
from ..interface.availability import rendering_problem
from ..interface.properties import technique_settings
from ..light_grid_options import TECHNIQUE, scene_grid_settings
from ..light_meshes import light_meshes
from ..render_process import KEPT
from . import bake_state, bake_store

KILOBYTE = 1000


@dataclass(frozen=True)
class BakedGrid:
    """A light grid, what it depends on, and the scene that it is for by name."""

    grid: GridBake
    key: BakeKey
    scene: str
    visibility: BakedVisibility | None


def bake_problem(context: Any) -> str | None:
    """Why no light grid can be baked, or None."""
    if context.scene.library is not None:
        return f"The scene is linked from {context.scene.library.filepath}: open that file, or make the scene local"
    if not light_meshes(context.scene):
        return "The scene has no virtual light mesh: create one first"
    return None


def clear_problem(context: Any) -> str | None:
    """Why there is no baked data to remove, or None."""
    if context.scene.library is not None:
        return f"The scene is linked from {context.scene.library.filepath}: open it, the baked data is its own"
    if not (bake_store.has_grid(context.scene) or bake_store.is_interrupted(context.scene)):
        return "No light grid is baked for this scene: Bake Light Grid makes one"
    return None


def from_scene(context: Any, with_visibility: bool = False) -> Callable[[Progress], BakedGrid]:
    """Work that bakes the scene's light grid, and what its surfaces see of its lights. Raises InvalidInput."""
    scene = context.scene
    bake_store.require_own(scene)
    settings = scene_grid_settings(scene)
    if settings is None:
        problem = "it sums all lights, without a light grid"
        raise InvalidInput(f"scene {scene.name!r}", problem, "choose Tolerance or Range for Lights (Render)")
    found = extract()
    if found.light_mesh is None:
        remedy = "create one, or show the one it has in this view layer"
        raise InvalidInput(f"scene {scene.name!r}", "it has no virtual lights", remedy)
    problem_of_device = rendering_problem()
    if with_visibility and problem_of_device is not None:
        raise InvalidInput("baked visibility", problem_of_device, "bake without it")
    snapshot, light_mesh, name = found.snapshot, found.light_mesh, scene.name
    values = technique_settings(scene, TECHNIQUE)

    def work(progress: Progress) -> BakedGrid:
        key = grid_key(snapshot.meshes, light_mesh, settings)
        grid = bake_light_grid(snapshot, light_mesh, settings, progress)
        visibility = None
        if with_visibility:
            cells, points = values["visibility_cells"], values["visibility_points"]
            visibility = KEPT.bake_visibility(snapshot, light_mesh, cells, points, progress)
        return BakedGrid(grid, key, name, visibility)

    return work


def write(context: Any, baked: BakedGrid) -> tuple[Path, str]:
    """Store what was baked; returns its file and a sentence. Raises InvalidInput."""
    scene = bpy.data.scenes.get(baked.scene)
    if scene is None:
        raise InvalidInput(f"scene {baked.scene!r}", "it is gone", "bake again")
    path = bake_store.store(scene, baked.grid.grid, baked.key, baked.visibility)
    # The scene may have been changed while the grid was baked: to know, it must be compared.
    bake_state.forget(context)
    size = _size_text(path.stat().st_size)
    findings = f"; {counted(len(baked.grid.findings), 'finding')}" if baked.grid.findings else ""
    return path, f"Baked {size}: {baked.grid.summary()}{findings}"


def clear(context: Any) -> str:
    """Remove the baked light grid of the scene; returns a sentence. Raises InvalidInput."""
    freed = bake_store.clear(context.scene)
    bake_state.forget(context)
    return f"Removed the baked light grid, {_size_text(freed)}"


def _size_text(count: int) -> str:
    return f"{count / KILOBYTE:,.0f} kB"
