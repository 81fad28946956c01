# SPDX-License-Identifier: GPL-3.0-or-later
"""Specular reflection of what lamps light, in their reflective shadow maps (seed 003, 4.3.1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...core.settings import setting
from ..gpu_layout import CONSTANTS, LAMP
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer
from .reflection_rays import DIAGONAL, GROUP_SIDE, RAYS_UNIT, RaySettings, ReflectionRays
from .rsm import ReflectiveShadowMap

if TYPE_CHECKING:
    import moderngl

MAP_UNIT = RAYS_UNIT + 4
DISTANCE_CHANNEL = 0
GEOMETRIC_NORMAL_UNIT, KNOWN_UNIT = MAP_UNIT + 3, MAP_UNIT + 4


@dataclass(frozen=True)
class MapReflectionSettings(RaySettings):
    """How rays are followed through the maps."""

    steps: int = setting(
        64, "count", 1, 4096, "Places along a ray in each face of a map at most", source="003, 4.2.4: left open"
    )
    halvings: int = setting(
        6, "count", 0, 24, "Of the step in which a ray goes behind a surface", source="003, 6.3.1: left open"
    )


class MapReflectionPass:
    """Light that specular lobes send to the eye from surfaces that lamps light: the rays of ScreenReflectionPass, each
    followed through every lamp's reflective shadow map.

    Light that reaches those surfaces in other ways than straight from a lamp is not in the maps, and their own
    highlights are not either. Surfaces that no lamp lights are not there, so that rays go through them.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._shaders = shaders
        self._rays = ReflectionRays(context, shaders, width, height, DISTANCE_CHANNEL)
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)
        self._nearest = context.texture((width, height), 2, dtype="f4")
        self._targets = context.framebuffer([self._rays.incoming, self._nearest])

    def render(
        self,
        gbuffer: GBuffer,
        view: View,
        maps: Iterable[ReflectiveShadowMap],
        space: LocalSpace,
        settings: MapReflectionSettings,
        sample_index: int,
        known: moderngl.Texture | None = None,
    ) -> moderngl.Texture:
        """RGBA32F: radiance in W/(m² sr) to the eye times confidence, and confidence in [0, 1].

        Of the hits in all maps the nearest counts, with what every lamp gives it. space: of the G-buffer. known: what
        `found` of ScreenReflectionPass is for the same picture: this is for what it leaves, so that both may be added.
        The next call overwrites the texture.
        """
        self._rays.sample(gbuffer, view, settings, sample_index)
        self._targets.clear()
        width, height = gbuffer.size
        for found in maps:
            self._lamp.orphan()
            self._lamp.write(found.record.tobytes())
            # Drawing a map binds textures and buffers of its own.
            gbuffer.bind()
            self._rays.rays.use(RAYS_UNIT)
            found.bind(MAP_UNIT)
            found.geometric_normal.use(GEOMETRIC_NORMAL_UNIT)
            if known is not None:
                known.use(KNOWN_UNIT)
            self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
            self._rays.incoming.bind_to_image(0)
            self._nearest.bind_to_image(1)
            scale, offset = space.to(found.space)
            lengths = {"reach": settings.reach * DIAGONAL * scale, "thickness": settings.thickness * DIAGONAL * scale}
            place = {"side": found.side, "map_scale": scale, "map_offset": offset.tolist()}
            shader = self._shader(found, known is not None)
            counts = {"steps": settings.steps, "halvings": settings.halvings}
            set_uniforms(shader, lengths | place | counts)
            shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
            self._context.memory_barrier()
        return self._rays.resolve(gbuffer, view, settings, self._nearest, sample_index)

    def _shader(self, found: ReflectiveShadowMap, has_known: bool) -> moderngl.ComputeShader:
        names = ("POSITION", "NORMAL", "FLUX", "GEOMETRIC_NORMAL")
        defines = {f"MAP_{name}_UNIT": MAP_UNIT + i for i, name in enumerate(names)}
        is_parallel = int(found.record["shadow_kind"][0]) == CONSTANTS["SHADOW_PARALLEL"]
        variant = {"IS_CUBE": found.is_cube, "IS_PARALLEL": is_parallel, "HAS_KNOWN": has_known}
        constants = {"GROUP_SIDE": GROUP_SIDE, "RAYS_UNIT": RAYS_UNIT, "KNOWN_UNIT": KNOWN_UNIT}
        return self._shaders.compute("passes/map_reflection.comp", {**constants, **defines, **variant})
