# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible surface of every pixel."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from ..geometry import GpuGeometry
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View

if TYPE_CHECKING:
    import moderngl


@dataclass(frozen=True)
class GBuffer:
    """Textures of one picture, row 0 at the bottom; packed as in `lib/gbuffer.glsl`.

    position: RGBA32F, m from the local origin, and depth along the direction of view in m. shading_normal: unit, on
    the viewer's side, and roughness. geometric_normal: likewise, and metallic. base_color: linear Rec.709, and
    specular IOR level. emission: radiance, and IOR. ids: RGBA32I, material, tag id, face id, model. Where a pixel
    shows no surface, all but the ids are zero, and the ids undefined.
    """

    position: moderngl.Texture
    shading_normal: moderngl.Texture
    geometric_normal: moderngl.Texture
    base_color: moderngl.Texture
    emission: moderngl.Texture
    ids: moderngl.Texture

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.position.size

    def bind(self) -> None:
        """Binds each texture to its unit GBUFFER_*_UNIT."""
        for field in fields(self):
            getattr(self, field.name).use(int(CONSTANTS[f"GBUFFER_{field.name.upper()}_UNIT"]))


class GBufferPass:
    """Position, normals, material and ids of what the camera sees."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._shaders = shaders
        size = (width, height)
        images = {
            field.name: context.texture(size, 4, dtype="i4" if field.name == "ids" else "f4")
            for field in fields(GBuffer)
        }
        self._gbuffer = GBuffer(**images)
        # 24 bits, which the shader spends evenly
        depth = context.depth_texture(size)
        self._framebuffer = context.framebuffer(list(images.values()), depth)

    def render(self, geometry: GpuGeometry, view: View, sample_index: int) -> GBuffer:
        """The surfaces that `view` shows; `sample_index` picks which transparent ones are let through.

        The next call overwrites the textures returned.
        """
        import moderngl

        defines = {name: True for name, present in geometry.variants.items() if present}
        program = self._shaders.program("passes/gbuffer.vert", "passes/gbuffer.frag", defines)
        set_uniforms(
            program,
            {
                "clip_from_local": view.clip_from_local,
                "camera_position": view.position,
                "camera_backward": view.backward,
                "is_orthographic": view.is_orthographic,
                "clip_distances": view.clip_distances,
                "ray": view.rays[0],
                "ray_right": view.rays[1],
                "ray_up": view.rays[2],
                "sample_index": sample_index,
            },
        )
        self._framebuffer.use()
        self._framebuffer.clear(depth=1.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        geometry.draw_materials(program)
        return self._gbuffer
