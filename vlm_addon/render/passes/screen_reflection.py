# SPDX-License-Identifier: GPL-3.0-or-later
"""Specular reflection of what the picture itself shows (seed 003, 4.2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...core.settings import OWN, setting
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .depth_pyramid import DepthPyramid
from .gbuffer import GBuffer
from .reflection_rays import DIAGONAL, GROUP_SIDE, RAYS_UNIT, RaySettings, ReflectionRays, pixel_size

if TYPE_CHECKING:
    import moderngl

LIT_UNIT, PYRAMID_UNIT = RAYS_UNIT + 1, RAYS_UNIT + 4
DISTANCE_CHANNEL = 2
ORTHOGRAPHIC_SCALE = 1.0
"""Homogeneous coordinate of all that an orthographic camera sees."""


@dataclass(frozen=True)
class ReflectionSettings(RaySettings):
    """How rays are followed through the picture."""

    steps: int = setting(
        512, "count", 1, 16384, "Squares of pixels that a ray visits at most", source="003, 4.2.4: left open"
    )
    edge_fade: float = setting(
        0.05, "share", 0.0, 0.5, "Of the picture's width and height, at its edges, over which hits fade", source=OWN
    )


class ScreenReflectionPass:
    """Light that specular lobes send to the eye from other surfaces in the picture: one ray for each pixel and picture.

    What a surface sends to the eye stands for what it sends to the reflecting one, so that highlights on it are those
    that the eye sees. Of the latest picture: hits, RGBA32F: place in pixels from the lower left corner, distance from
    the reflecting surface in m, and confidence; all 0 where the pixel's own ray found nothing. found, RGBA32F: radiance
    along that ray in W/(m² sr) times confidence, and confidence.
    """

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int, settings: ReflectionSettings
    ) -> None:
        self._context = context
        self._settings = settings
        self._pyramid = DepthPyramid(context, shaders, width, height)
        self._rays = ReflectionRays(context, shaders, width, height, DISTANCE_CHANNEL)
        units = {"RAYS_UNIT": RAYS_UNIT, "LIT_UNIT": LIT_UNIT, "PYRAMID_UNIT": PYRAMID_UNIT}
        self._shader = shaders.compute("passes/screen_reflection.comp", {"GROUP_SIDE": GROUP_SIDE, **units})
        self.found = self._rays.incoming
        self.hits = context.texture((width, height), 4, dtype="f4")

    def render(self, gbuffer: GBuffer, view: View, lit: moderngl.Texture, sample_index: int) -> moderngl.Texture:
        """RGBA32F: radiance in W/(m² sr) to the eye times confidence, and confidence in [0, 1].

        It is 0 where the ray leaves the picture, ends, or passes behind things that are thinner, and falls to 0
        towards the picture's edges, behind what is seen of things, and with roughness. lit: radiance that each pixel
        sends to the eye, RGBA32F of the same size. The next call overwrites the texture.
        """
        settings, (width, height) = self._settings, gbuffer.size
        self._rays.sample(gbuffer, view, settings, sample_index)
        pyramid = self._pyramid.render(gbuffer, view)
        gbuffer.bind()
        self._rays.rays.use(RAYS_UNIT)
        lit.use(LIT_UNIT)
        pyramid.use(PYRAMID_UNIT)
        self._rays.incoming.bind_to_image(0, read=False, write=True)
        self.hits.bind_to_image(1, read=False, write=True)
        followed = {
            "clip_from_local": view.clip_from_local,
            "nearest": ORTHOGRAPHIC_SCALE if view.is_orthographic else view.clip_distances[0],
            "pixel_size": pixel_size(view, width),
            "reach": settings.reach * DIAGONAL,
            "thickness": settings.thickness * DIAGONAL,
            "edge_fade": settings.edge_fade,
            "steps": settings.steps,
            "coarsest": self._pyramid.coarsest,
        }
        set_uniforms(self._shader, view.camera_uniforms() | followed)
        self._shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()
        return self._rays.resolve(gbuffer, view, settings, self.hits, sample_index)
