# SPDX-License-Identifier: GPL-3.0-or-later
"""The Virtual Light Mesh: light that its virtual lights send to each pixel (seed 002, chapters 3 and 4)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...core.light_grid import FEW_LIGHTS, RANGE, TOLERANCE, GridSettings
from ...core.range_grid import RangeSettings
from ...core.settings import setting
from ..light_sums import CellSum, ClusteredSum, FullSum, LightSum
from ..passes.phase_one import PhaseOnePass
from ..technique import FrameInputs, SceneInputs, Technique
from ..virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl

ALL = "all"


def _of_grid(name: str, only_with: str) -> Any:
    """The setting `name` of a light grid, which counts where `lights` is `only_with`."""
    field = next(field for field in dataclasses.fields(GridSettings) if field.name == name)
    return dataclasses.field(default=field.default, metadata={**field.metadata, "only_with": ("lights", only_with)})


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
    tolerance: float = _of_grid("tolerance", TOLERANCE)
    grid: int = _of_grid("grid", RANGE)
    range: float = _of_grid("range", RANGE)
    max_lights: int = _of_grid("max_lights", RANGE)


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
        before = dict(scene.kept.built)
        self._sum = self._chosen_sum()
        kinds = self._sum.kinds
        self._built = {f"{kind}_built": scene.kept.built.get(kind, 0) - before.get(kind, 0) for kind in kinds}

    def _chosen_sum(self) -> LightSum:
        """How the lights are summed."""
        chosen, inputs = self.chosen, (self.scene, self._lights, self._radiosity)
        if chosen.lights == RANGE:
            return CellSum(*inputs, RangeSettings(chosen.grid, chosen.range, chosen.max_lights))
        if chosen.lights == TOLERANCE and self._lights.count > FEW_LIGHTS:
            return ClusteredSum(*inputs, chosen.tolerance)
        return FullSum(*inputs)

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the lights of radiosity times form factor."""
        with self.scene.timer.measure("phase two"):
            return self._sum.render(frame.gbuffer, frame.progress)

    def counters(self) -> dict[str, float]:
        """Virtual lights, which structures were built in this frame (0: kept), and what their lists hold."""
        return {"virtual_lights": self._lights.count, **self._built, **self._sum.counters()}

    def reasons(self) -> list[str]:
        """Why all lights are summed where a tolerance was asked for, and why light is missing with a range."""
        if self.chosen.lights != TOLERANCE or not isinstance(self._sum, FullSum):
            return self._sum.reasons()
        return [f"all {self._lights.count} virtual lights are summed: that costs no more than clusters of so few"]
