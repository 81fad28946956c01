# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes into passes that find indirect light in glossy surfaces, and what is made of what they found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..albedo_texture import AlbedoTexture
from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .accumulate import PictureLight
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

FIRST_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])


class LitPicturePass:
    """What each pixel sends to the eye without indirect light in glossy surfaces: what these then show."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._shaders = shaders
        self._albedo = AlbedoTexture(context)
        self._lit = context.texture((width, height), 4, dtype="f4")
        self._framebuffer = context.framebuffer([self._lit])

    def render(self, gbuffer: GBuffer, view: View, light: PictureLight) -> moderngl.Texture:
        """Radiance, RGBA32F, w 1 where a surface shows; 0 elsewhere. The next call overwrites the texture."""
        fullscreen = FullscreenPass(self._context, self._shaders, "passes/lit_picture.frag", light.bind())
        gbuffer.bind()
        self._albedo.bind()
        set_uniforms(fullscreen.program, view.camera_uniforms())
        fullscreen.draw(self._framebuffer)
        return self._lit


class SpecularMixPass:
    """Puts together what several passes found in glossy surfaces: each leaves to the next what it has not found."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._shaders = shaders
        self._mixed = context.texture((width, height), 4, dtype="f4")
        self._framebuffer = context.framebuffer([self._mixed])

    def render(
        self,
        own: moderngl.Texture | None,
        screen: moderngl.Texture | None,
        maps: moderngl.Texture | None,
        lights: moderngl.Texture | None,
    ) -> moderngl.Texture:
        """Radiance, RGBA32F. own: of the technique, added. screen, maps, lights: in this order, rgb times the share
        that was found, w that share. The next call overwrites the texture."""
        defines: dict[str, int | float | bool | str] = {}
        names = ("OWN_UNIT", "SCREEN_UNIT", "MAPS_UNIT", "LIGHTS_UNIT")
        for unit, (name, texture) in enumerate(zip(names, (own, screen, maps, lights), strict=True), FIRST_UNIT):
            if texture is not None:
                texture.use(unit)
                defines[name] = unit
        FullscreenPass(self._context, self._shaders, "passes/specular_mix.frag", defines).draw(self._framebuffer)
        return self._mixed
