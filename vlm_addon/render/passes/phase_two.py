# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from every virtual light, without a structure over the lights."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.progress import Progress, step
from ...core.scene import UNTAGGED
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from ..virtual_lights import GpuVirtualLights
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

# Invocations and pixels per side of a tile: each invocation shades a square of pixels, so that a light is fetched
# once for all of them.
GROUP_SIDE = 8
PIXELS_PER_SIDE = 2
TILE_SIDE = GROUP_SIDE * PIXELS_PER_SIDE
# A dispatch of this many evaluations ends within a second on two cores, so no driver takes it for hung and a
# cancellation is seen; a GPU does it in some milliseconds.
EVALUATIONS_PER_DISPATCH = 30_000_000
MIN_LIGHTS_PER_DISPATCH = 64
# Mesa's software renderers end all loops of an invocation after 65,535 iterations together, without a word; a light
# takes one, and one more for each pixel of the invocation.
MAX_LIGHTS_PER_DISPATCH = 8192


class PhaseTwoPass:
    """The sum over all lights of radiosity times form factor (seed 002, eq. 3.1 and 3.3)."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._size = (width, height)
        self._irradiance = context.texture((width, height), 4, dtype="f4")
        self._target = context.framebuffer([self._irradiance])
        defines = {"GROUP_SIDE": GROUP_SIDE, "PIXELS_PER_SIDE": PIXELS_PER_SIDE, "UNTAGGED": UNTAGGED}
        self._shader = shaders.compute("passes/phase_two.comp", defines)
        self._context = context

    def render(
        self, gbuffer: GBuffer, lights: GpuVirtualLights, radiosity: moderngl.Buffer, progress: Progress
    ) -> moderngl.Texture:
        """Irradiance in W/m² on the shading normal's side of each pixel, RGBA32F; 0 where no surface shows.

        radiosity: one vec4 a light, rgb in W/m². Lights and surfaces of the same non-zero tag id leave each other
        out. `progress` hears of each dispatch and may cancel. The next call overwrites the texture.
        """
        width, height = self._size
        self._target.clear()
        gbuffer.bind()
        lights.bind()
        radiosity.bind_to_storage_buffer(int(CONSTANTS["RADIOSITY_BINDING"]))
        self._irradiance.bind_to_image(0)
        tiles_x, tiles_y = -(-width // TILE_SIDE), -(-height // TILE_SIDE)
        chunk = EVALUATIONS_PER_DISPATCH // (width * height)
        chunk = min(max(chunk, MIN_LIGHTS_PER_DISPATCH), MAX_LIGHTS_PER_DISPATCH)
        for first in range(0, lights.count, chunk):
            end = min(first + chunk, lights.count)
            set_uniforms(self._shader, {"first_light": first, "end_light": end})
            self._shader.run(tiles_x, tiles_y)
            self._context.memory_barrier()
            step(progress, end / lights.count, "phase two")
        return self._irradiance
