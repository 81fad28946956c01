# SPDX-License-Identifier: GPL-3.0-or-later
"""The Virtual Light Mesh: light that its virtual lights send to each pixel (seed 002, chapters 3 and 4)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...core.settings import setting
from ..light_forest import GpuLightForest, make_forest
from ..passes.phase_one import PhaseOnePass, read_radiosity
from ..passes.phase_two import PhaseTwoPass
from ..passes.phase_two_clustered import ClusteredPhaseTwoPass
from ..technique import FrameInputs, SceneInputs, Technique
from ..virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl

TOLERANCE, RANGE, ALL = "tolerance", "range", "all"
FEW_LIGHTS = 400
"""Up to so many, all lights cost no more than clusters of them."""


@dataclass(frozen=True)
class Settings:
    """Which lights are summed for a pixel."""

    lights: str = setting(
        TOLERANCE,
        "",
        None,
        None,
        "Near lights and clusters of far ones (tolerance), those of the pixel's grid cell (range), or all",
        source="002, 4",
        choices=(TOLERANCE, RANGE, ALL),
    )
    tolerance: float = setting(0.02, "", 1e-4, 1.0, "Error of the irradiance, as a share of it", source="002, 4")
    grid: int = setting(50, "cells", 1, 256, "Cells along each side of the scene's box", source="002, 4.1")
    range: float = setting(4.0, "radii", 0.0, 1e6, "How far a light reaches", source="002, 4.2")
    max_lights: int = setting(0, "lights", 0, 1_000_000, "Most lights a cell holds", source="002, 4.1")


class VirtualLightMeshTechnique(Technique):
    """One diffuse bounce from the triangles of the light mesh.

    Known bias: indirect light is not occluded (seed 002, 3.6), each light has one radiosity all over, light that
    leaves a surface by its specular layer does not bounce, and there is one bounce. With a tolerance, irradiance may be
    off by that share; with a range, the light of all lights that are farther away is missing.
    """

    name = "vlm"
    label = "Virtual Light Mesh"
    description = "One diffuse bounce from the virtual lights, exact form factors, without occlusion between them"
    settings = Settings
    needs_light_mesh = True

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        assert scene.light_mesh is not None
        self._lights = GpuVirtualLights(scene.context, scene.light_mesh, scene.geometry.origin)
        phase_one = PhaseOnePass(scene.context, scene.shaders)
        with scene.timer.measure("phase one"):
            self._radiosity = phase_one.render(
                scene.light_mesh, scene.geometry.origin, scene.shadows, scene.settings.shadow_samples, scene.progress
            )
        size = scene.settings.width, scene.settings.height
        self._pixels = size[0] * size[1]
        self._built: dict[str, float] = {}
        self._clustered: ClusteredPhaseTwoPass | None = None
        self._samples = 0
        if settings.lights == TOLERANCE and self._lights.count > FEW_LIGHTS:
            self._clustered = ClusteredPhaseTwoPass(scene.context, scene.shaders, *size)
            self._forest = self._make_forest()
        else:
            self._phase_two = PhaseTwoPass(scene.context, scene.shaders, *size)

    def _make_forest(self) -> GpuLightForest:
        """The clusters of the lights as they shine now."""
        scene = self.scene
        assert scene.world_lights is not None
        before = dict(scene.structures.built)
        with scene.timer.measure("relight"):
            radiosity = read_radiosity(self._radiosity, self._lights.count)
            trees = scene.structures.trees(scene.world_lights, radiosity, self.chosen.tolerance)
            forest = GpuLightForest(scene.context, make_forest(trees, scene.space, self._lights.count))
        kinds = ("static_tree", "dynamic_tree", "static_clusters", "dynamic_clusters")
        after = scene.structures.built
        self._built = {f"{kind}_built": after.get(kind, 0) - before.get(kind, 0) for kind in kinds}
        return forest

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the lights of radiosity times form factor."""
        self._samples += 1
        with self.scene.timer.measure("phase two"):
            if self._clustered is not None:
                return self._clustered.render(
                    frame.gbuffer, self._lights, self._radiosity, self._forest, frame.progress
                )
            return self._phase_two.render(frame.gbuffer, self._lights, self._radiosity, frame.progress)

    def counters(self) -> dict[str, float]:
        """Virtual lights, what was built, and how many lights and clusters each pixel's list holds on average."""
        counted: dict[str, float] = {"virtual_lights": self._lights.count, **self._built}
        if self._clustered is None:
            return counted | {"evaluations": self._samples * self._pixels * self._lights.count}
        per_tile = self._clustered.entries / max(self._clustered.tiles, 1)
        return counted | {"lists_entries": self._clustered.entries, "evaluated_per_pixel": per_tile}
