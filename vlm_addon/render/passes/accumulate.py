# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of jittered pictures, and where in a pixel each of them looks."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import Environment, Float32, Float64
from ..albedo_texture import AlbedoTexture
from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

DIRECT_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
IRRADIANCE_UNIT = DIRECT_UNIT + 1
ENVIRONMENT_UNIT = DIRECT_UNIT + 4
SPECULAR_UNIT = DIRECT_UNIT + 5
OPENNESS_UNIT = DIRECT_UNIT + 6
OUTPUTS = ("combined", "direct", "indirect")
MORE_OUTPUTS = ("irradiance", "specular")
"""Where every intermediate image is wanted."""


@dataclass(frozen=True)
class PictureLight:
    """What falls on, and leaves, the surfaces of one picture; textures of the G-buffer's size, None for nothing.

    direct: radiance that lamps send to the eye. irradiance: W/m², indirect. openness: share of that which is not
    occluded, in r; None for all. specular: radiance of indirect light in glossy surfaces.
    """

    direct: moderngl.Texture | None = None
    irradiance: moderngl.Texture | None = None
    openness: moderngl.Texture | None = None
    specular: moderngl.Texture | None = None

    def bind(self) -> dict[str, int | float | bool | str]:
        """Binds what there is; the names by which passes/picture_light.glsl knows it."""
        defines: dict[str, int | float | bool | str] = {}
        units = (DIRECT_UNIT, IRRADIANCE_UNIT, OPENNESS_UNIT, SPECULAR_UNIT)
        for unit, field in zip(units, fields(self), strict=True):
            texture = getattr(self, field.name)
            if texture is not None:
                texture.use(unit)
                defines[f"{field.name.upper()}_UNIT"] = unit
        return defines


class AccumulatePass:
    """Emission, direct and indirect light of each sample, averaged over the samples with equal weights (box filter).

    Sums are float32: after n samples they are good to n/2 units in the last place. A value that is not a number
    stays in its pixel.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        width: int,
        height: int,
        environment: Environment | None = None,
        *,
        every_output: bool = True,
    ) -> None:
        """environment: what shows where no surface does, on top of the same from everywhere. every_output: also
        MORE_OUTPUTS."""
        self._outputs = (*OUTPUTS, *MORE_OUTPUTS) if every_output else OUTPUTS
        self._environment = environment
        self._environment_map = None if environment is None else _environment_texture(context, environment)
        self._context = context
        self._shaders = shaders
        self._sums = [context.texture((width, height), 4, dtype="f4") for _ in self._outputs]
        self._framebuffer = context.framebuffer(self._sums)
        self._framebuffer.clear()
        self._albedo = AlbedoTexture(context)

    def add(
        self,
        gbuffer: GBuffer,
        light: PictureLight,
        view: View,
        world_radiance: tuple[float, float, float],
        weight: float,
    ) -> None:
        """Adds one picture. weight: one over the sample count."""
        defines = light.bind()
        if self._outputs != OUTPUTS:
            defines["EVERY_OUTPUT"] = True
        if self._environment_map is not None:
            defines["ENVIRONMENT_UNIT"] = ENVIRONMENT_UNIT
            self._environment_map.use(ENVIRONMENT_UNIT)
        combine = FullscreenPass(self._context, self._shaders, "passes/accumulate.frag", defines)
        gbuffer.bind()
        self._albedo.bind()
        set_uniforms(
            combine.program,
            {
                **view.camera_uniforms(),
                "world_radiance": world_radiance,
                "weight": weight,
            },
        )
        if self._environment is not None:
            set_uniforms(combine.program, _background_rays(view, self._environment))
        combine.draw(self._framebuffer, additive=True)

    def read(self) -> dict[str, Float32]:
        """The sums by their names: (h, w, 4) float32, row 0 at the top; `direct` has coverage as alpha."""
        return {name: read_image(texture) for name, texture in zip(self._outputs, self._sums, strict=True)}


def _environment_texture(context: moderngl.Context, environment: Environment) -> moderngl.Texture:
    import moderngl

    height, width = environment.radiance.shape[:2]
    texture = context.texture(
        (width, height), 3, np.ascontiguousarray(environment.radiance, "<f4").tobytes(), dtype="f4"
    )
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x, texture.repeat_y = True, False
    return texture


def _background_rays(view: View, environment: Environment) -> dict[str, Float64]:
    """Uniforms: direction in the map's frame through the picture's corner, and by how much it differs for a pixel."""
    rays = view.rays.copy()
    if view.is_orthographic:
        rays[0] = -view.backward
    corner, right, up = rays @ environment.map_from_world.T
    return {"background_corner": corner, "background_right": right, "background_up": up}


def read_image(texture: moderngl.Texture) -> np.ndarray:
    """The texture's pixels, (h, w, c) float32 or int32, row 0 at the top."""
    width, height = texture.size
    kind = np.int32 if texture.dtype == "i4" else np.float32
    return np.frombuffer(texture.read(), kind).reshape(height, width, texture.components)[::-1].copy()


def jitter_offsets(samples: int) -> Float64:
    """(samples, 2) float64: where each picture looks in a pixel, from its centre, in [-0.5, 0.5), mean 0.

    Hammersley's points: one in each of `samples` columns, and evenly spread over the rows.
    """
    indices = np.arange(samples)
    rows, digit, rest = np.zeros(samples), 0.5, indices.copy()
    while rest.any():
        rows += digit * (rest & 1)
        rest >>= 1
        digit *= 0.5
    offsets = np.stack([(indices + 0.5) / samples, rows], axis=1)
    return offsets - offsets.mean(axis=0)
