# SPDX-License-Identifier: GPL-3.0-or-later
"""Through what views a lamp's shadow map is drawn: what is in them, and what the map's record says of it."""

from __future__ import annotations

import math

import numpy as np

from ..core.scene import AREA, SPOT, SUN, Float64, Light
from .gpu_layout import CONSTANTS
from .shadow_windows import Bounds, ShadowWindow

Viewport = tuple[int, int, int, int]

# Above this cone one perspective map wastes most of its texels on the rim.
WIDEST_CONE = math.radians(120.0)
NARROWEST_CONE = 1e-6
"""Tangent of half the angle of a map; a spot without a cone shines nowhere."""
# Faces of a cube: index of the axis that looks forward, its sign. The other two axes follow cyclically.
CUBE_FACES = ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0))
FRONT_FACE = 5
CUBE_TILES = (int(CONSTANTS["SHADOW_CUBE_COLUMNS"]), int(CONSTANTS["SHADOW_CUBE_ROWS"]))
# Texels around what must be seen, for the filter.
MARGIN = 2.0
# Nearest occluder that counts, of the distance to the farthest: no precision depends on it.
NEAREST = 1e-6


def shadow_kind(light: Light) -> str:
    """Name of the projection of a lamp's map, among gpu_layout.CONSTANTS."""
    if light.kind == SUN:
        return "SHADOW_PARALLEL"
    if light.kind == SPOT and light.spot_angle * max(1.0, *light.spot_scale) <= WIDEST_CONE:
        return "SHADOW_CONE"
    return "SHADOW_CUBE"


def shadow_views(
    light: Light, record: np.ndarray, bounds: Bounds, window: ShadowWindow | None, size: tuple[int, int]
) -> list[tuple[Float64, Viewport]]:
    """Matrix to clip space from the offset to `shadow_origin`, and viewport of each tile of a map of `size` texels;
    fills the shadow fields of `record`. bounds: of all that can show in it."""
    corners = _box_corners(*bounds)
    axes = np.array([record[name][0] for name in ("x_axis", "y_axis", "z_axis")], np.float64)
    width, height = size
    if light.kind == SUN:
        if window is None:
            matrix = _fitted_view(record, corners, axes, width)
        else:
            matrix = _window_view(record, window, 0.5 * (bounds[0] + bounds[1]), axes, width)
        return [(matrix, (0, 0, width, height))]
    record["shadow_origin"] = record["sample_position"]
    origin = record["sample_position"][0].astype(np.float64)
    seen = (corners - origin) @ axes.T
    near = NEAREST * float(np.linalg.norm(seen, axis=1).max())
    record["shadow_near"] = near
    if shadow_kind(light) == "SHADOW_CONE":
        tangents = math.tan(0.5 * light.spot_angle) * np.array(light.spot_scale) * cone_widening(width)
        tangents = np.maximum(tangents, NARROWEST_CONE)
        record["shadow_extent"] = tangents
        return [(_perspective(axes, FRONT_FACE, tangents, near), (0, 0, width, height))]
    side = width // CUBE_TILES[0]
    tangents = np.full(2, cone_widening(side))
    record["shadow_extent"] = tangents
    return [
        (_perspective(axes, face, tangents, near), _tile(face, side))
        for face in range(len(CUBE_FACES))
        if _may_see(light, face, seen, float(tangents[0]))
    ]


def cone_widening(side: int) -> float:
    """By how much the tangents of a tile of `side` texels are larger than those of what must show in it."""
    return 1.0 / (1.0 - 2.0 * MARGIN / side)


def _tile(face: int, side: int) -> tuple[int, int, int, int]:
    """Viewport of a cube's face in its map."""
    return face % CUBE_TILES[0] * side, face // CUBE_TILES[0] * side, side, side


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
