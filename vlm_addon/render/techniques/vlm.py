# SPDX-License-Identifier: GPL-3.0-or-later
"""The Virtual Light Mesh, summed over all its lights (seed 002, chapter 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..passes.phase_one import PhaseOnePass
from ..passes.phase_two import PhaseTwoPass
from ..technique import FrameInputs, SceneInputs, Technique
from ..virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl


class VirtualLightMeshTechnique(Technique):
    """One diffuse bounce from the triangles of the light mesh.

    Known bias: indirect light is not occluded (seed 002, 3.6), each light has one radiosity all over, light that
    leaves a surface by its specular layer does not bounce, and there is one bounce.
    """

    name = "vlm"
    label = "Virtual Light Mesh"
    description = "One diffuse bounce from every virtual light, exact form factors, without occlusion between them"
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
        self._phase_two = PhaseTwoPass(scene.context, scene.shaders, scene.settings.width, scene.settings.height)
        self._evaluations = 0

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over all lights of radiosity times form factor."""
        width, height = frame.gbuffer.size
        self._evaluations += width * height * self._lights.count
        with self.scene.timer.measure("phase two"):
            return self._phase_two.render(frame.gbuffer, self._lights, self._radiosity, frame.progress)

    def counters(self) -> dict[str, float]:
        """Virtual lights, and for how many pairs of a light and a pixel of a sample they were summed."""
        return {"virtual_lights": self._lights.count, "evaluations": self._evaluations}
