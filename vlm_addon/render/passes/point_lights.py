# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from virtual point lights (seed 001, 3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.progress import Progress, step
from ...core.scene import Float32, Float64
from ..gpu_layout import VIRTUAL_POINT_LIGHT
from ..shader_library import ShaderLibrary, set_uniforms
from .accumulate import read_image
from .gbuffer import GBuffer
from .phase_two import IrradianceImage, entry_runs

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
LIGHT_BINDING = 0
RECEIVER_COLUMNS = 32


@dataclass(frozen=True)
class PointLights:
    """Lights on the device: `count` of VIRTUAL_POINT_LIGHT in `buffer`."""

    buffer: moderngl.Buffer
    count: int

    def records(self) -> np.ndarray:
        """(count,) of VIRTUAL_POINT_LIGHT; waits for the device."""
        if not self.count:
            return VIRTUAL_POINT_LIGHT.zeros(0)
        return np.frombuffer(self.buffer.read(), VIRTUAL_POINT_LIGHT.dtype)[: self.count]


def uploaded(context: moderngl.Context, records: np.ndarray) -> PointLights:
    """Lights of (n,) `records`."""
    if not len(records):
        return PointLights(context.buffer(reserve=VIRTUAL_POINT_LIGHT.dtype.itemsize), 0)
    return PointLights(context.buffer(records.tobytes()), len(records))


class PointLightPass:
    """Irradiance of every pixel from point lights, less that from negative ones; may be negative."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._irradiance = IrradianceImage(context, width, height)
        defines = {"GROUP_SIDE": GROUP_SIDE, "LIGHT_BINDING": LIGHT_BINDING, "SHOWS_BOUND": False}
        self._shaders = {
            negative: shaders.compute("passes/point_lights.comp", {**defines, "NEGATIVE": negative})
            for negative in (False, True)
        }

    def render(
        self, gbuffer: GBuffer, lights: PointLights, negative: PointLights, brightest: Float64, progress: Progress
    ) -> moderngl.Texture:
        """In W/m², RGBA32F; w: what negative lights take away, mean of the channels.

        brightest: (3,) W/m², what no sum over `lights` exceeds. `progress` hears of each dispatch and may cancel. The
        next call overwrites the texture.
        """
        self._irradiance.clear()
        gbuffer.bind()
        width, height = self._irradiance.size
        whole = max(lights.count + negative.count, 1)
        for is_negative, summed in ((False, lights), (True, negative)):
            shader = self._shaders[is_negative]
            summed.buffer.bind_to_storage_buffer(LIGHT_BINDING)
            for first, end in entry_runs(summed.count, width * height):
                is_last = end == summed.count
                set_uniforms(shader, {"first": first, "end": end, "is_last": is_last, "brightest": brightest.tolist()})
                shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
                self._context.memory_barrier()
                step(progress, (end + is_negative * lights.count) / whole, "gather")
        return self._irradiance.texture


class BoundPass:
    """How much of the light on surface points the bounded geometry term takes off."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, points: Float64, normals: Float64) -> None:
        """points, normals: (p, 3) of surface points, in units of the lights' space."""
        self._context = context
        rows = -(-len(points) // RECEIVER_COLUMNS)
        self._irradiance = IrradianceImage(context, RECEIVER_COLUMNS, max(rows, 1))
        position, normal = (self._image(values) for values in (points, normals))
        ids = context.texture(self._irradiance.size, 4, dtype="i4")
        # Only places and normals are looked at.
        self._gbuffer = GBuffer(position, normal, normal, position, position, ids)
        defines = {"GROUP_SIDE": GROUP_SIDE, "LIGHT_BINDING": LIGHT_BINDING, "SHOWS_BOUND": True, "NEGATIVE": False}
        self._shader = shaders.compute("passes/point_lights.comp", defines)

    def _image(self, values: Float64) -> moderngl.Texture:
        width, height = self._irradiance.size
        image = np.zeros((width * height, 4), np.float32)
        image[: len(values), :3] = values
        return self._context.texture((width, height), 4, image.tobytes(), dtype="f4")

    def share(self, lights: PointLights, brightest: float) -> float:
        """In [0, 1). brightest: W/m², mean of the channels, that no irradiance exceeds: what is more is the pole of the
        unbounded term, not light that is missing. Waits for the device."""
        if not lights.count:
            return 0.0
        self._irradiance.clear()
        self._gbuffer.bind()
        lights.buffer.bind_to_storage_buffer(LIGHT_BINDING)
        set_uniforms(self._shader, {"first": 0, "end": lights.count})
        width, height = self._irradiance.size
        self._shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()
        found: Float32 = read_image(self._irradiance.texture)
        kept = found[..., :3].mean(axis=2, dtype=np.float64)
        lost = np.minimum(found[..., 3], np.maximum(brightest - kept, 0.0)).sum()
        return float(lost / (kept.sum() + lost)) if lost > 0.0 else 0.0
