# SPDX-License-Identifier: GPL-3.0-or-later
"""Fragment passes over every pixel of a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .shader_library import Defines, ShaderLibrary

if TYPE_CHECKING:
    import moderngl

FULLSCREEN_VERTEX = "passes/fullscreen.vert"


class FullscreenPass:
    """One fragment shader run once for each pixel of a framebuffer."""

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, fragment: str, defines: Defines | None = None
    ) -> None:
        """fragment: path of the shader file. Raises ShaderError."""
        self._context = context
        self.program = shaders.program(FULLSCREEN_VERTEX, fragment, defines)
        self._vertex_array = context.vertex_array(self.program, [])

    def draw(self, target: moderngl.Framebuffer, *, additive: bool = False) -> None:
        """Runs the shader over `target`, replacing its pixels or adding to them."""
        import moderngl

        target.use()
        self._context.enable_only(moderngl.BLEND if additive else moderngl.NOTHING)
        if additive:
            self._context.blend_func = moderngl.ONE, moderngl.ONE
        self._vertex_array.render(moderngl.TRIANGLES, vertices=3)
