# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from every virtual light, without a structure over the lights."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...core.progress import Progress, step
from ..gpu_layout import CONSTANTS
from ..shader_library import Defines, ShaderLibrary, set_uniforms
from ..virtual_lights import GpuVirtualLights
from .baked_pixels import PixelVisibility
from .gbuffer import GBuffer
from .light_picks import PICK_DEFINES, LightPicks
from .tile_bounds import TILE_BINDING, TILE_DEFINES, TileBoundsPass, Tiles

if TYPE_CHECKING:
    import moderngl

# A dispatch of this many evaluations ends within a second on two cores, so no driver takes it for hung and a
# cancellation is seen; a GPU does it in some milliseconds.
EVALUATIONS_PER_DISPATCH = 30_000_000
MIN_LIGHTS_PER_DISPATCH = 64
# Mesa's software renderers end all loops of an invocation after 65,535 iterations together, without a word; a light
# takes one, and one more for each pixel of the invocation.
MAX_LIGHTS_PER_DISPATCH = 8192
PHASE_TWO_DEFINES = {**TILE_DEFINES, **PICK_DEFINES, "PICKS": False, "BAKED": False}


class IrradianceImage:
    """Irradiance in W/m² that passes add to; RGBA32F, image unit 0 of their shaders."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        self.size = (width, height)
        self.texture = context.texture(self.size, 4, dtype="f4")
        self._target = context.framebuffer([self.texture])

    def clear(self) -> None:
        """Sets all to 0 and binds the image."""
        self._target.clear()
        self.texture.bind_to_image(0)


_DEFINES = {**PHASE_TWO_DEFINES, "LISTED": False}


class LightSumPass(ABC):
    """What every form of phase two has."""

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        width: int,
        height: int,
        visibility: PixelVisibility | None = None,
    ) -> None:
        """visibility: what the sum is multiplied by, light by light; None for 1."""
        self._context = context
        self._visibility = visibility
        self._shaders = shaders
        self._irradiance = IrradianceImage(context, width, height)
        self._tile_bounds = TileBoundsPass(context, shaders, width, height)
        self._prepare()

    @property
    def _sum_defines(self) -> Defines:
        """Of shaders that sum lights as far as visibility says."""
        return {} if self._visibility is None else self._visibility.defines

    @abstractmethod
    def _prepare(self) -> None:
        """Makes the shaders of one form."""


class PhaseTwoPass(LightSumPass):
    """The sum over all lights of radiosity times form factor (seed 002, eq. 3.1 and 3.3)."""

    def _prepare(self) -> None:
        self._shader = self._shaders.compute("passes/phase_two.comp", {**_DEFINES, **self._sum_defines})

    def render(
        self, gbuffer: GBuffer, lights: GpuVirtualLights, radiosity: moderngl.Buffer, progress: Progress
    ) -> moderngl.Texture:
        """Irradiance in W/m² on the shading normal's side of each pixel, RGBA32F; 0 where no surface shows.

        radiosity: one vec4 a light, rgb in W/m². Lights leave out surfaces as
        core.light_links.leaves_out says. `progress` hears of each dispatch and may cancel. The next call overwrites
        the texture.
        """
        self._irradiance.clear()
        most = MAX_LIGHTS_PER_DISPATCH
        if self._visibility is not None:
            self._visibility.bind(self._shader)
            most = self._visibility.per_dispatch(most)
        self._walk(self._shader, most, gbuffer, lights, radiosity, progress)
        return self._irradiance.texture

    def pick(
        self,
        picks: LightPicks,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        progress: Progress,
    ) -> None:
        """Fills `picks` from the lights that the last `render` added up, with its arguments."""
        shader = self._shaders.compute("passes/phase_two.comp", {**_DEFINES, **picks.defines})
        picks.begin(shader, self._irradiance.texture)
        self._walk(shader, picks.per_dispatch(MAX_LIGHTS_PER_DISPATCH), gbuffer, lights, radiosity, progress)

    def _walk(
        self,
        shader: moderngl.ComputeShader,
        most: int,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        progress: Progress,
    ) -> None:
        """most: lights of a dispatch."""
        tiles = self._tile_bounds.render(gbuffer)
        bind_lights(tiles, lights, radiosity)
        width, height = tiles.size
        for first, end in entry_runs(lights.count, width * height, most):
            set_uniforms(shader, {**tiles.uniforms(), "first_entry": first, "end_entry": end})
            shader.run(*tiles.grid)
            self._context.memory_barrier()
            step(progress, end / lights.count, "phase two")


def bind_lights(tiles: Tiles, lights: GpuVirtualLights, radiosity: moderngl.Buffer) -> None:
    """Binds what every form of phase two reads."""
    tiles.bounds.bind_to_storage_buffer(TILE_BINDING)
    lights.bind()
    radiosity.bind_to_storage_buffer(int(CONSTANTS["RADIOSITY_BINDING"]))


def entry_runs(longest: int, pixels: int, most: int = MAX_LIGHTS_PER_DISPATCH) -> Iterator[tuple[int, int]]:
    """First and end of the runs in which `longest` lights are summed for so many pixels, one run a dispatch.

    most: lights of a run.
    """
    chunk = EVALUATIONS_PER_DISPATCH // max(pixels, 1)
    chunk = min(max(chunk, MIN_LIGHTS_PER_DISPATCH), most)
    for first in range(0, longest, chunk):
        yield first, min(first + chunk, longest)
