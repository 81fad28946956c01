# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked visibility in the pictures of one frame: what light sums multiply each light and cluster by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..core.array_codec import content_hash
from ..core.light_grid import LitTree
from .passes.baked_pixels import BakedPixelsPass, PixelVisibility
from .scene_visibility import CLUSTER_KIND, KIND, coarser_text, dense_text, forest_shares, scene_visibility
from .technique import FrameInputs, SceneInputs

if TYPE_CHECKING:
    from ..core.light_mesh import VirtualLightMesh


class BakedSettings(Protocol):
    """What a technique's settings say of baked visibility; see core/settings.py for each."""

    visibility_cells: int
    visibility_points: int


class BakedLights:
    """Of one frame; what is baked is kept over frames. kinds: of what is kept."""

    kinds = (KIND, CLUSTER_KIND)

    def __init__(self, scene: SceneInputs, settings: BakedSettings) -> None:
        """Bakes what is not kept. Raises as scene_visibility."""
        assert scene.world_lights is not None
        self._scene, self._chosen = scene, settings
        self._light_mesh: VirtualLightMesh = scene.world_lights
        context, shaders = scene.context, scene.shaders
        with scene.timer.measure("bake visibility"):
            self._visibility = scene_visibility(
                context,
                shaders,
                scene.kept,
                scene.world,
                self._light_mesh,
                settings.visibility_cells,
                settings.visibility_points,
                scene.progress,
            )
        self._visibility.forget_counts()
        self._pixels = BakedPixelsPass(context, shaders, scene.settings.width, scene.settings.height)

    def of_lights(self) -> PixelVisibility:
        """For sums of lights alone."""
        return PixelVisibility(self._pixels, self._visibility.light_shares, len(self._light_mesh))

    def of_trees(self, trees: list[LitTree]) -> PixelVisibility:
        """For sums of lights and of the clusters of `trees`, one tree after the other."""
        state = content_hash([[lit.tree.light_order, lit.tree.light_offsets, lit.tree.parent] for lit in trees])
        clusters = forest_shares(self._scene.kept, self._visibility, trees, self._light_mesh, state)
        count = sum(len(lit.tree) for lit in trees)
        return PixelVisibility(self._pixels, self._visibility.light_shares, len(self._light_mesh), clusters, count)

    def find(self, frame: FrameInputs) -> None:
        """Finds the rows of each pixel of the picture that is going to be lit."""
        with self._scene.timer.measure("baked rows"):
            self._pixels.render(frame.gbuffer, frame.view, self._scene.space, self._visibility)

    def _counted(self) -> tuple[int, int]:
        """Pixels of samples so far whose zone was not found, and those without any row."""
        unknown, bare = np.frombuffer(self._visibility.counts.read(), np.uint32).tolist()
        return unknown, bare

    def counters(self) -> dict[str, float]:
        """Cells along the longest axis, different rows, megabytes, ways looked at to bake them,
        and pixels of samples whose zone was not found or that have no row."""
        baked, (unknown, bare) = self._visibility.baked, self._counted()
        return {
            "visibility_cells": baked.cells_per_axis,
            "visibility_rows": len(baked.shares),
            "visibility_mb": 1e-6 * baked.nbytes,
            "visibility_ways": baked.ways,
            "visibility_pixels_between": unknown,
            "visibility_pixels_without": bare,
        }

    def reasons(self) -> list[str]:
        """Why cells are coarser than asked for, or too coarse, and where surfaces count as seeing all."""
        baked, scene = self._visibility.baked, self._scene
        found = [coarser_text(baked, self._chosen.visibility_cells), dense_text(scene.kept, scene.world, baked)]
        if bare := self._counted()[1]:
            text = f"{bare:,} pixels of samples show surfaces of which no visibility is baked: they see every light"
            found.append(text)
        return [text for text in found if text]
