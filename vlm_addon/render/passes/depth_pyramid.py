# SPDX-License-Identifier: GPL-3.0-or-later
"""The nearest depth in squares of pixels, from one pixel up to the whole picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.scene import Float64
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
DEPTH_EMPTY = 1e30
"""Depth, in m, where a square shows nothing."""


class DepthPyramid:
    """A mip map of depths for rays that are followed through a picture."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        import moderngl

        self._context = context
        defines: dict[str, int | float] = {"GROUP_SIDE": GROUP_SIDE, "DEPTH_EMPTY": DEPTH_EMPTY}
        self._finest = shaders.compute("passes/depth_pyramid_finest.comp", defines)
        self._coarser = shaders.compute("passes/depth_pyramid.comp", defines)
        # Powers of two, so that every square of every level is whole.
        size = _power_of_two(width), _power_of_two(height)
        self.coarsest = max(size).bit_length() - 1
        self._texture = context.texture(size, 1, dtype="f4")
        self._texture.build_mipmaps(0, self.coarsest)
        self._texture.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)

    def render(self, gbuffer: GBuffer, view: View) -> moderngl.Texture:
        """R32F, levels 0 to `coarsest`: of the surfaces in a square of 2^level pixels the nearest depth in m, no more
        than that of any point that the square shows; DEPTH_EMPTY for none. The next call overwrites the texture."""
        gbuffer.bind()
        right, up = _pixel_steps(view, *gbuffer.size)
        camera = {
            "camera_position": view.position,
            "camera_backward": view.backward,
            "is_orthographic": view.is_orthographic,
            "pixel_right": right,
            "pixel_up": up,
        }
        set_uniforms(self._finest, camera)
        self._texture.bind_to_image(0, read=False, write=True)
        self._run(self._finest, self._texture.size)
        width, height = self._texture.size
        for level in range(1, self.coarsest + 1):
            self._texture.bind_to_image(0, read=True, write=False, level=level - 1)
            self._texture.bind_to_image(1, read=False, write=True, level=level)
            self._run(self._coarser, (max(width >> level, 1), max(height >> level, 1)))
        return self._texture

    def _run(self, shader: moderngl.ComputeShader, size: tuple[int, int]) -> None:
        shader.run(-(-size[0] // GROUP_SIDE), -(-size[1] // GROUP_SIDE))
        self._context.memory_barrier()


def _power_of_two(pixels: int) -> int:
    """The least that is not below."""
    return 1 << (pixels - 1).bit_length()


def _pixel_steps(view: View, width: int, height: int) -> tuple[Float64, Float64]:
    """(3,) each: what leads to the next pixel to the right and up, m; for a perspective camera per m of depth."""
    if not view.is_orthographic:
        return view.rays[1], view.rays[2]
    across, upwards = view.clip_from_local[0, :3], view.clip_from_local[1, :3]
    return across * (2.0 / (width * (across @ across))), upwards * (2.0 / (height * (upwards @ upwards)))
