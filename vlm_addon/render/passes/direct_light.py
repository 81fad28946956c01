# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that comes straight from the lamps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..albedo_texture import AlbedoTexture
from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS, LAMP
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer
from .shadow_map import LampShadows

if TYPE_CHECKING:
    import moderngl


class DirectLightPass:
    """Diffuse and specular reflection of every lamp, one draw for each, with filtered shadows.

    Each call takes one point of every soft lamp; the mean over all sample indices converges to the soft shadow.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._radiance = context.texture((width, height), 4, dtype="f4")
        self._framebuffer = context.framebuffer([self._radiance])
        self._fullscreen = FullscreenPass(context, shaders, "passes/direct_light.frag")
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)
        self._albedo = AlbedoTexture(context)

    def render(
        self, gbuffer: GBuffer, shadows: LampShadows, view: View, sample_index: int, sample_count: int
    ) -> moderngl.Texture:
        """Radiance in W/(m² sr) that each pixel sends to the eye, RGBA32F with w 0; 0 where no surface shows.

        The next call overwrites the texture.
        """
        self._framebuffer.clear()
        self._albedo.bind()
        for index in range(len(shadows.lights)):
            shadow_map = shadows.shadow_map(index, sample_index, sample_count)
            self._lamp.write(shadow_map.record.tobytes())
            self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
            # Drawing a shadow map binds the materials' textures to the units of the G-buffer.
            gbuffer.bind()
            shadow_map.bind()
            set_uniforms(
                self._fullscreen.program,
                {
                    "camera_position": view.position,
                    "camera_backward": view.backward,
                    "is_orthographic": view.is_orthographic,
                },
            )
            self._fullscreen.draw(self._framebuffer, additive=True)
        return self._radiance
