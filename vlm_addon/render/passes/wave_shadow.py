# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows of some virtual point lights of a wave, over each pixel (seed 000, 3.3 and 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ...core.lamps import LampSample
from ...core.scene import SPOT, Float64, Light
from ...core.stacked_hemispheres import integrated_shadow_count
from ..geometry import GpuGeometry
from ..gpu_layout import CONSTANTS, LAMP
from ..lamp_records import lamp_record
from ..local_space import HALF_DIAGONAL, LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..shadow_views import NEAREST
from .gbuffer import GBuffer
from .shadow_map import FRAGMENT, ROUNDING, VERTEX

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
FIRST_MAP_UNIT = int(CONSTANTS["SHADOW_MAP_UNIT"])
SECOND_MAP_UNIT = FIRST_MAP_UNIT + 1
MAP_TANGENT = 3.0**0.5
"""Of half the angle of a map's smaller side: 120 degrees, more along the larger one. The seed leaves it open."""
# What every visible surface is nearer than, and the nearest that counts: maps are the same in every local space.
_FARTHEST = 8.0 * HALF_DIAGONAL
NEAR = NEAREST * _FARTHEST


@dataclass(frozen=True)
class WaveMaps:
    """What some lights of a wave see. positions: (m, 3) float64; frames: (m, 3, 3) of core.light_wave, both
    in world space. textures: R32F of nearness as in lib/shadow.glsl, one for each."""

    positions: Float64
    frames: Float64
    textures: tuple[moderngl.Texture, ...]


class WaveMapPass:
    """Draws what virtual point lights see along their normals."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, size: tuple[int, int]) -> None:
        """size: width and height of a map, texels."""
        self._context = context
        self._shaders = shaders
        self._size = size

    def draw(self, geometry: GpuGeometry, space: LocalSpace, positions: Float64, frames: Float64) -> WaveMaps:
        """One map along the third row of each of (m, 3, 3) `frames` from (m, 3) `positions`, both in world space."""
        textures = tuple(
            self._draw_one(geometry, self.record(space, position, frame))
            for position, frame in zip(positions, frames, strict=True)
        )
        return WaveMaps(positions, frames, textures)

    def record(self, space: LocalSpace, position: Float64, frame: Float64) -> np.ndarray:
        """(1,) of gpu_layout.LAMP for a map of this pass."""
        place = space.local_points(position)
        light = Light(
            name="virtual point light",
            kind=SPOT,
            power=(0.0, 0.0, 0.0),
            position=_vector(place),
            x_axis=_vector(frame[0]),
            y_axis=_vector(-frame[1]),
            z_axis=_vector(-frame[2]),
        )
        record = lamp_record(light, LampSample(place, np.zeros((0, 2)), 1.0), np.zeros(3))
        record["shadow_kind"] = CONSTANTS["SHADOW_CONE"]
        record["shadow_rounding"] = ROUNDING * HALF_DIAGONAL
        record["shadow_origin"] = place
        record["shadow_near"] = NEAR
        record["shadow_extent"] = MAP_TANGENT * np.array(self._size) / min(self._size)
        return record

    def _draw_one(self, geometry: GpuGeometry, record: np.ndarray) -> moderngl.Texture:
        import moderngl

        texture = self._context.texture(self._size, 1, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        framebuffer = self._context.framebuffer([texture])
        framebuffer.clear()
        framebuffer.use()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        self._context.blend_equation = moderngl.MAX  # type: ignore[assignment]
        uniforms = {
            "clip_from_shadow": _clip_matrix(record),
            "shadow_origin": record["shadow_origin"][0],
            "is_parallel": False,
            "shadow_near": NEAR,
            "sample_index": 0,
        }
        opaque = self._shaders.program(VERTEX, FRAGMENT)
        set_uniforms(opaque, uniforms)
        geometry.draw_opaque(opaque)
        if geometry.has_alpha:
            program = self._shaders.program(VERTEX, FRAGMENT, {"HAS_ALPHA": True})
            set_uniforms(program, uniforms)
            geometry.draw_with_alpha(program)
        self._context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        return texture


def _vector(values: Float64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _clip_matrix(record: np.ndarray) -> Float64:
    """Of a perspective map with w = distance along its axis, without far plane."""
    right, up, backward = (record[name][0].astype(np.float64) for name in ("x_axis", "y_axis", "z_axis"))
    extent = record["shadow_extent"][0].astype(np.float64)
    matrix = np.zeros((4, 4))
    matrix[:, :3] = right / extent[0], up / extent[1], -backward, -backward
    matrix[2, 3] = -2.0 * NEAR
    return matrix


class WaveShadowPass:
    """Share of a wave that each pixel sees by its maps."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._visibility = context.texture((width, height), 1, dtype="f4")
        self._target = context.framebuffer([self._visibility])
        self._lamps = context.buffer(reserve=2 * LAMP.dtype.itemsize)
        defines = {"GROUP_SIDE": GROUP_SIDE, "FIRST_MAP_UNIT": FIRST_MAP_UNIT, "SECOND_MAP_UNIT": SECOND_MAP_UNIT}
        self._shaders = shaders
        self._defines = defines

    def accurate(self, gbuffer: GBuffer, maps: WaveMaps, records: Sequence[np.ndarray]) -> moderngl.Texture:
        """Mean over the maps, R32F in [0, 1]; 1 where no map looks. The next call overwrites the texture."""
        self._begin(gbuffer)
        for record, texture in zip(records, maps.textures, strict=True):
            self._add([record], [texture], {"share": 1.0 / len(records)})
        return self._visibility

    def integrated(
        self, gbuffer: GBuffer, maps: WaveMaps, records: Sequence[np.ndarray], steps: int
    ) -> moderngl.Texture:
        """Mean over all pairs of maps and `steps` steps between both (seed 000, eq. 4.8), likewise."""
        self._begin(gbuffer)
        share = 1.0 / integrated_shadow_count(len(records), steps)
        for first, second in combinations(range(len(records)), 2):
            pair = [records[first], records[second]]
            self._add(pair, [maps.textures[first], maps.textures[second]], {"share": share, "steps": steps})
        return self._visibility

    def _begin(self, gbuffer: GBuffer) -> None:
        self._target.clear()
        gbuffer.bind()
        self._visibility.bind_to_image(0)

    def _add(
        self, records: list[np.ndarray], textures: list[moderngl.Texture], uniforms: dict[str, int | float]
    ) -> None:
        shader = self._shaders.compute("passes/wave_shadow.comp", {**self._defines, "IS_PAIR": len(records) == 2})
        # Joined by numpy they would lose their padding.
        together = LAMP.zeros(len(records))
        for index, record in enumerate(records):
            together[index] = record[0]
        # New storage: llvmpipe (Mesa 22) lets a write overtake work that still reads the old one.
        self._lamps.orphan()
        self._lamps.write(together.tobytes())
        self._lamps.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
        for unit, texture in enumerate(textures, start=FIRST_MAP_UNIT):
            texture.use(unit)
        set_uniforms(shader, uniforms)
        width, height = self._visibility.size
        shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()
