# SPDX-License-Identifier: GPL-3.0-or-later
"""What each lamp sees: maps of nearness that tell which surface points it lights."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.lamps import is_soft, lamp_samples
from ...core.scene import AREA, SPOT, SUN, Float64, Light
from ..geometry import GpuGeometry
from ..gpu_layout import CONSTANTS
from ..lamp_records import lamp_record
from ..shader_library import ShaderLibrary, set_uniforms
from ..shadow_windows import ShadowWindow

if TYPE_CHECKING:
    import moderngl

VERTEX, FRAGMENT = "passes/shadow_map.vert", "passes/shadow_map.frag"
# Above this cone one perspective map wastes most of its texels on the rim.
WIDEST_CONE = math.radians(120.0)
NARROWEST_CONE = 1e-6
"""Tangent of half the angle of a map; a spot without a cone shines nowhere."""
# Faces of a cube: index of the axis that looks forward, its sign. The other two axes follow cyclically.
CUBE_FACES = ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0))
FRONT_FACE = 5
CUBE_TILES = (int(CONSTANTS["SHADOW_CUBE_COLUMNS"]), int(CONSTANTS["SHADOW_CUBE_ROWS"]))
# A map of one tile has this many times the cube's texels per side: about as many in all.
SINGLE_TILE_FACTOR = 2
# Maps of soft lamps are this much coarser: many of them are averaged, and drawn for every picture.
SOFT_DIVISOR = 2
WORLD_DIVISOR = 4
"""Likewise maps of the world's light from more than SHARP_ANGLE: its lights' number makes the error, not texels."""
SHARP_ANGLE = math.radians(4.0)
LEAST_RESOLUTION = 16
# Texels around what must be seen, for the filter.
MARGIN = 2.0
# Nearest occluder that counts, of the distance to the farthest: no precision depends on it.
NEAREST = 1e-6
# Rounding of a vertex and of its interpolation, of half the scene's diagonal.
ROUNDING = 2.0**-23
# Height of what a sun's map does not show, m.
EMPTY_HEIGHT = -1e30
# Bytes of maps that are kept for all samples of a frame; further lamps are drawn again.
CACHE_BYTES = 1 << 29


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
        """resolution: texels along a cube's face; a map of a single view has twice as many, soft lamps half."""
        self._context = context
        self._opaque = shaders.program(VERTEX, FRAGMENT)
        self._shaders = shaders
        # The largest map, three tiles wide, must fit a texture.
        self._resolution = min(resolution, int(context.info["GL_MAX_TEXTURE_SIZE"]) // max(CUBE_TILES))
        self._empty = self._new_texture((2, 2))
        context.framebuffer([self._empty]).clear()

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
    ) -> ShadowMap:
        """The map of one of `sample_count` points of `light`, drawn over `texture` if one is given.

        together: how many consecutive points are used in one picture. window: the part of the scene that the map of a
        SUN must show; all of it by default.

        A lamp that casts no shadow, or a scene without triangles, gives an empty map.
        """
        samples = lamp_samples(light, sample_count, together)
        sample = samples[sample_index % len(samples)]
        record = lamp_record(light, sample, geometry.origin)
        if not light.casts_shadow or geometry.triangle_count == 0:
            return ShadowMap(self._empty, record)
        record["shadow_kind"] = CONSTANTS[shadow_kind(light)]
        record["shadow_rounding"] = ROUNDING * 0.5 * float(np.linalg.norm(geometry.high - geometry.low))
        target = texture or self.new_texture(light)
        framebuffer = self._context.framebuffer([target])
        framebuffer.clear(red=EMPTY_HEIGHT if light.kind == SUN else 0.0)
        for matrix, viewport in self._views(light, record, geometry, window):
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

    def _views(
        self, light: Light, record: np.ndarray, geometry: GpuGeometry, window: ShadowWindow | None
    ) -> list[tuple[Float64, tuple[int, int, int, int]]]:
        """Matrix to clip space from the offset to `shadow_origin`, and viewport of each tile; fills the shadow fields
        of `record`."""
        corners = _box_corners(geometry.low, geometry.high)
        axes = np.array([record[name][0] for name in ("x_axis", "y_axis", "z_axis")], np.float64)
        width, height = self.size(light)
        if light.kind == SUN:
            if window is None:
                matrix = _fitted_view(record, corners, axes, width)
            else:
                matrix = _window_view(record, window, 0.5 * (geometry.low + geometry.high), axes, width)
            return [(matrix, (0, 0, width, height))]
        record["shadow_origin"] = record["sample_position"]
        origin = record["sample_position"][0].astype(np.float64)
        seen = (corners - origin) @ axes.T
        near = NEAREST * float(np.linalg.norm(seen, axis=1).max())
        record["shadow_near"] = near
        if shadow_kind(light) == "SHADOW_CONE":
            tangents = math.tan(0.5 * light.spot_angle) * np.array(light.spot_scale) / (1.0 - 2.0 * MARGIN / width)
            tangents = np.maximum(tangents, NARROWEST_CONE)
            record["shadow_extent"] = tangents
            return [(_perspective(axes, FRONT_FACE, tangents, near), (0, 0, width, height))]
        side = self._face(light)
        tangents = np.full(2, 1.0 / (1.0 - 2.0 * MARGIN / side))
        record["shadow_extent"] = tangents
        return [
            (_perspective(axes, face, tangents, near), _tile(face, side))
            for face in range(len(CUBE_FACES))
            if _may_see(light, face, seen, float(tangents[0]))
        ]


def _tile(face: int, side: int) -> tuple[int, int, int, int]:
    """Viewport of a cube's face in its map."""
    return face % CUBE_TILES[0] * side, face // CUBE_TILES[0] * side, side, side


def shadow_kind(light: Light) -> str:
    """Name of the projection of a lamp's map, among gpu_layout.CONSTANTS."""
    if light.kind == SUN:
        return "SHADOW_PARALLEL"
    if light.kind == SPOT and light.spot_angle * max(1.0, *light.spot_scale) <= WIDEST_CONE:
        return "SHADOW_CONE"
    return "SHADOW_CUBE"


def _box_corners(low: Float64, high: Float64) -> Float64:
    return np.array([[(low, high)[bit][axis] for axis, bit in enumerate(bits)] for bits in np.ndindex(2, 2, 2)])


def _may_see(light: Light, face: int, seen: Float64, tangent: float) -> bool:
    """Whether a cube's face can hold an occluder: the scene's bounds, in the lamp's frame, reach into its frustum."""
    axis, sign = CUBE_FACES[face]
    if light.kind in (AREA, SPOT) and axis == 2 and sign > 0.0:
        return False
    forward = sign * seen[:, axis]
    if (forward <= 0.0).all():
        return False
    sides = [seen[:, (axis + 1) % 3], seen[:, (axis + 2) % 3]]
    return not any((side * way > tangent * forward).all() for side in sides for way in (1.0, -1.0))


def _perspective(axes: Float64, face: int, tangents: Float64, near: float) -> Float64:
    """Clip matrix of a face with w = distance along its axis, without far plane."""
    axis, sign = CUBE_FACES[face]
    right, up, forward = axes[(axis + 1) % 3], axes[(axis + 2) % 3], sign * axes[axis]
    matrix = np.zeros((4, 4))
    matrix[:, :3] = right / tangents[0], up / tangents[1], forward, forward
    matrix[2, 3] = -2.0 * near
    return matrix


def _fitted_view(record: np.ndarray, corners: Float64, axes: Float64, side: int) -> Float64:
    """Clip matrix of a parallel map that fits `corners` (8, 3)."""
    middle = corners.mean(axis=0)
    seen = (corners - middle) @ axes.T
    # A flat or empty extent still gets a size.
    least = 1e-6 * max(float(np.abs(corners).max()), float(np.abs(seen).max()), 1e-30)
    half = np.maximum(np.abs(seen[:, :2]).max(axis=0), least) / (1.0 - 2.0 * MARGIN / side)
    return _parallel(record, middle, np.zeros(2), half, axes)


def _window_view(record: np.ndarray, window: ShadowWindow, anchor: Float64, axes: Float64, side: int) -> Float64:
    """Clip matrix of a parallel map of `window`. Its texels lie on a grid through `anchor`, wherever the window is."""
    texel = 2.0 * window.radius / (side - 2.0 * (MARGIN + 1.0))
    centre = np.array(window.centre)
    place = (centre - anchor) @ axes[:2].T
    return _parallel(record, centre, texel * np.round(place / texel) - place, np.full(2, 0.5 * side * texel), axes)


def _parallel(record: np.ndarray, origin: Float64, centre: Float64, half: Float64, axes: Float64) -> Float64:
    """Clip matrix of a parallel map; depth is not clipped."""
    record["shadow_origin"] = origin
    # What is lost in rounding the origin is given back.
    centre = centre + (origin - record["shadow_origin"][0].astype(np.float64)) @ axes[:2].T
    record["shadow_extent"], record["shadow_centre"] = half, centre
    matrix = np.zeros((4, 4))
    matrix[:2, :3], matrix[:2, 3], matrix[3, 3] = axes[:2] / half[:, None], -centre / half, 1.0
    return matrix


class _KeptMaps:
    """Maps that never change, and textures for those that do, by size."""

    def __init__(self) -> None:
        self.kept: dict[tuple[Light, ShadowWindow | None], ShadowMap] = {}
        self.kept_bytes = 0
        self.shared: dict[tuple[int, int], moderngl.Texture] = {}


class LampShadows:
    """The maps of a scene's lamps over the samples of a frame: those that never change are drawn once."""

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        geometry: GpuGeometry,
        lights: Sequence[Light],
        resolution: int,
    ) -> None:
        self.lights = tuple(lights)
        self._geometry = geometry
        self._pass = ShadowMapPass(context, shaders, resolution)
        self._maps = _KeptMaps()

    def for_lights(self, lights: Sequence[Light]) -> LampShadows:
        """The same for other lights; what both have is drawn once for both."""
        other = copy.copy(self)
        other.lights = tuple(lights)
        return other

    @property
    def bounds(self) -> tuple[Float64, Float64]:
        """Lower and upper corner of all that casts shadows, (3,) float64, m from the local origin."""
        return self._geometry.low, self._geometry.high

    def uses_windows(self, lamp_index: int) -> bool:
        """Whether the lamp's map can be confined to a part of the scene."""
        light = self.lights[lamp_index]
        return light.kind == SUN and light.casts_shadow and self._geometry.triangle_count > 0

    def side(self, lamp_index: int) -> int:
        """Texels along the lamp's map."""
        return self._pass.size(self.lights[lamp_index])[0]

    def shadow_map(
        self,
        lamp_index: int,
        sample_index: int,
        sample_count: int,
        together: int = 1,
        window: ShadowWindow | None = None,
    ) -> ShadowMap:
        """The map of one of `sample_count` samples of a lamp; valid until the next call for another one.

        together: how many consecutive samples are used in one picture. window: as in ShadowMapPass.render.
        """
        light, maps = self.lights[lamp_index], self._maps
        key = (light, window)
        if key in maps.kept:
            return maps.kept[key]
        width, height = self._pass.size(light)
        if self._changes(light) or maps.kept_bytes >= CACHE_BYTES:
            if (width, height) not in maps.shared:
                maps.shared[width, height] = self._pass.new_texture(light)
            texture = maps.shared[width, height]
            return self._pass.render(self._geometry, light, sample_index, sample_count, together, texture, window)
        maps.kept[key] = self._pass.render(self._geometry, light, sample_index, sample_count, window=window)
        maps.kept_bytes += 4 * width * height
        return maps.kept[key]

    def samples_of(self, lamp_index: int, most: int) -> int:
        """How many samples of a lamp differ, at most `most`."""
        light = self.lights[lamp_index]
        return most if self._changes(light) and not light.from_world else 1

    def _changes(self, light: Light) -> bool:
        """Whether samples differ: points of a soft lamp, or occluders that are let through by chance."""
        return is_soft(light) or (light.casts_shadow and self._geometry.has_alpha)
