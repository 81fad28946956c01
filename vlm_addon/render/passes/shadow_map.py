# SPDX-License-Identifier: GPL-3.0-or-later
"""What each lamp sees: maps of nearness that tell which surface points it lights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.lamps import is_soft, lamp_samples
from ...core.scene import SUN, Float64, Light
from ..geometry import GpuGeometry
from ..gpu_layout import CONSTANTS
from ..lamp_records import lamp_record
from ..shader_library import ShaderLibrary, set_uniforms
from ..shadow_views import CUBE_TILES, shadow_kind, shadow_views
from ..shadow_windows import Bounds, ShadowWindow

if TYPE_CHECKING:
    import moderngl

VERTEX, FRAGMENT = "passes/shadow_map.vert", "passes/shadow_map.frag"
# A map of one tile has this many times the cube's texels per side: about as many in all.
SINGLE_TILE_FACTOR = 2
# Maps of soft lamps are this much coarser: many of them are averaged, and drawn for every picture.
SOFT_DIVISOR = 2
WORLD_DIVISOR = 4
"""Likewise maps of the world's light from more than SHARP_ANGLE: its lights' number makes the error, not texels."""
SHARP_ANGLE = math.radians(4.0)
LEAST_RESOLUTION = 16
# Rounding of a vertex and of its interpolation, of half the scene's diagonal.
ROUNDING = 2.0**-23
# Height of what a sun's map does not show, m.
EMPTY_HEIGHT = -1e30


@dataclass(frozen=True)
class ShadowMap:
    """A lamp's sample and what it sees.

    texture: R32F of nearness as in lib/shadow.glsl, unfiltered. record: (1,) of gpu_layout.LAMP.
    """

    texture: moderngl.Texture
    record: np.ndarray

    def bind(self) -> None:
        """Binds the map to its texture unit."""
        self.texture.use(int(CONSTANTS["SHADOW_MAP_UNIT"]))


class ShadowMapPass:
    """Draws maps of nearness for lamps of every kind."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, resolution: int) -> None:
        """resolution: texels along a cube's face; a map of a single view has twice as many, soft lamps half.

        empty: the texture of maps without any shadow.
        """
        self._context = context
        self._opaque = shaders.program(VERTEX, FRAGMENT)
        self._shaders = shaders
        # The largest map, three tiles wide, must fit a texture.
        self._resolution = min(resolution, int(context.info["GL_MAX_TEXTURE_SIZE"]) // max(CUBE_TILES))
        self.empty = self._new_texture((2, 2))
        context.framebuffer([self.empty]).clear()

    def new_texture(self, light: Light) -> moderngl.Texture:
        """A texture of the size that maps of `light` need."""
        return self._new_texture(self.size(light))

    def _new_texture(self, size: tuple[int, int]) -> moderngl.Texture:
        import moderngl

        texture = self._context.texture(size, 1, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        return texture

    def size(self, light: Light) -> tuple[int, int]:
        """Width and height of the maps of `light`, texels."""
        face = self._face(light)
        if shadow_kind(light) == "SHADOW_CUBE":
            return CUBE_TILES[0] * face, CUBE_TILES[1] * face
        return SINGLE_TILE_FACTOR * face, SINGLE_TILE_FACTOR * face

    def _face(self, light: Light) -> int:
        """Texels along a cube's face."""
        divisor = SOFT_DIVISOR if is_soft(light) else 1
        if light.from_world and light.angle > SHARP_ANGLE:
            divisor = WORLD_DIVISOR
        return max(self._resolution // divisor, LEAST_RESOLUTION)

    def render(
        self,
        geometry: GpuGeometry,
        light: Light,
        sample_index: int,
        sample_count: int,
        together: int = 1,
        texture: moderngl.Texture | None = None,
        window: ShadowWindow | None = None,
        bounds: Bounds | None = None,
    ) -> ShadowMap:
        """The map of one of `sample_count` points of `light`, drawn over `texture` if one is given.

        together: how many consecutive points are used in one picture. window: the part of the scene that the map of a
        SUN must show; all of it by default. bounds: of all that can show in the map; the geometry's by default.

        A lamp that casts no shadow, or a scene without triangles, gives an empty map.
        """
        samples = lamp_samples(light, sample_count, together)
        sample = samples[sample_index % len(samples)]
        record = lamp_record(light, sample, geometry.origin)
        if not light.casts_shadow or geometry.triangle_count == 0:
            return ShadowMap(self.empty, record)
        record["shadow_kind"] = CONSTANTS[shadow_kind(light)]
        record["shadow_rounding"] = rounding((geometry.low, geometry.high))
        target = texture or self.new_texture(light)
        framebuffer = self._context.framebuffer([target])
        framebuffer.clear(red=EMPTY_HEIGHT if light.kind == SUN else 0.0)
        seen = bounds or (geometry.low, geometry.high)
        for matrix, viewport in shadow_views(light, record, seen, window, self.size(light)):
            framebuffer.viewport = viewport
            self._draw(framebuffer, geometry, matrix, record, sample_index)
        return ShadowMap(target, record)

    def _draw(
        self,
        framebuffer: moderngl.Framebuffer,
        geometry: GpuGeometry,
        clip_from_shadow: Float64,
        record: np.ndarray,
        sample_index: int,
    ) -> None:
        import moderngl

        framebuffer.use()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        self._context.blend_equation = moderngl.MAX  # type: ignore[assignment]
        uniforms = {
            "clip_from_shadow": clip_from_shadow,
            "shadow_origin": record["shadow_origin"][0],
            "towards_sun": record["z_axis"][0],
            "is_parallel": int(record["shadow_kind"][0]) == CONSTANTS["SHADOW_PARALLEL"],
            "shadow_near": float(record["shadow_near"][0]),
            "sample_index": sample_index,
        }
        set_uniforms(self._opaque, uniforms)
        geometry.draw_opaque(self._opaque)
        if geometry.has_alpha:
            program = self._shaders.program(VERTEX, FRAGMENT, {"HAS_ALPHA": True})
            set_uniforms(program, uniforms)
            geometry.draw_with_alpha(program)
        self._context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]


def rounding(bounds: Bounds) -> float:
    """What float32 leaves of the places of vertices within `bounds`, m."""
    return ROUNDING * 0.5 * float(np.linalg.norm(bounds[1] - bounds[0]))
