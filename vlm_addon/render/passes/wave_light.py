# SPDX-License-Identifier: GPL-3.0-or-later
"""What the virtual point lights of a wave bring to corners of triangles or to pixels, without shadows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.light_wave import Wave
from ...core.progress import Progress, step
from ..albedo_texture import AlbedoTexture
from ..geometry import GpuGeometry
from ..gpu_layout import CONSTANTS
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from ..wave_corners import BYTES_PER_CORNER, GpuCorners
from .gbuffer import GBuffer
from .phase_two import IrradianceImage, entry_runs

if TYPE_CHECKING:
    import moderngl

GROUP_SIZE = 64
GROUP_SIDE = 8
POINT_BINDING, LIGHT_BINDING, FACE_BINDING = 2, 3, 5
RESULT_BINDING = int(CONSTANTS["RESULT_BINDING"])
WAVE_DEFINES = {
    "GROUP_SIDE": GROUP_SIDE,
    "GROUP_SIZE": GROUP_SIZE,
    "POINT_BINDING": POINT_BINDING,
    "LIGHT_BINDING": LIGHT_BINDING,
    "FACE_BINDING": FACE_BINDING,
}


@dataclass(frozen=True)
class GpuWave:
    """A wave's lights: three vec4 each, as in passes/wave_light.comp. solid_angle: sr, that a ray stands for."""

    lights: moderngl.Buffer
    count: int
    solid_angle: float


def upload_wave(context: moderngl.Context, wave: Wave, space: LocalSpace, strength: float) -> GpuWave:
    """The wave in local space, its light times `strength`."""
    rows = np.zeros((max(len(wave), 1), 3, 4), np.float32)
    rows[: len(wave), 0, :3] = space.local_points(wave.positions)
    rows[: len(wave), 1, :3] = wave.normals
    rows[: len(wave), 2, :3] = strength * wave.irradiance
    rows[: len(wave), :, 3] = strength * wave.specular_irradiance
    rays = max(np.count_nonzero(wave.shells == wave.shells.max(initial=0)), 1)
    return GpuWave(context.buffer(rows.tobytes()), len(wave), 2.0 * math.pi / rays)


class WaveLightPass:
    """Sums of eq. 4.5 of seed 000."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, has_specular: bool) -> None:
        """has_specular: also what the specular layer reflects to the eye."""
        self._context = context
        self._albedo = AlbedoTexture(context)
        self._shaders = shaders
        self._defines = {**WAVE_DEFINES, "HAS_SPECULAR": has_specular}

    def at_corners(
        self, geometry: GpuGeometry, corners: GpuCorners, wave: GpuWave, view: View, progress: Progress
    ) -> moderngl.Buffer:
        """Three vec4 for each corner: irradiance on its normal's side and on the other one, W/m², and radiance of the
        specular layer towards the eye. `progress` hears of each dispatch and may cancel."""
        sums = self._context.buffer(reserve=BYTES_PER_CORNER * max(corners.count, 1))
        sums.clear()
        geometry.bind()
        corners.points.bind_to_storage_buffer(POINT_BINDING)
        sums.bind_to_storage_buffer(RESULT_BINDING)
        groups = (-(-corners.count // GROUP_SIZE), 1)
        self._run(True, wave, view, corners.count, groups, {"point_count": corners.count}, progress)
        return sums

    def at_pixels(
        self,
        gbuffer: GBuffer,
        wave: GpuWave,
        view: View,
        irradiance: IrradianceImage,
        specular: IrradianceImage,
        progress: Progress,
    ) -> None:
        """Replaces both images by the sums at each pixel."""
        specular.clear()
        irradiance.clear()
        gbuffer.bind()
        specular.texture.bind_to_image(1)
        width, height = irradiance.size
        groups = (-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._run(False, wave, view, width * height, groups, {}, progress)

    def _run(
        self,
        at_corners: bool,
        wave: GpuWave,
        view: View,
        points: int,
        groups: tuple[int, int],
        uniforms: dict[str, Any],
        progress: Progress,
    ) -> None:
        if not points:
            return
        shader = self._shaders.compute("passes/wave_light.comp", {**self._defines, "AT_CORNERS": at_corners})
        self._albedo.bind()
        wave.lights.bind_to_storage_buffer(LIGHT_BINDING)
        uniforms |= {
            "camera_position": view.position,
            "camera_backward": view.backward,
            "is_orthographic": view.is_orthographic,
            "solid_angle": wave.solid_angle,
        }
        for first, end in entry_runs(wave.count, points):
            set_uniforms(shader, {**uniforms, "first_light": first, "end_light": end})
            shader.run(*groups)
            self._context.memory_barrier()
            step(progress, end / wave.count, "wave of light")
