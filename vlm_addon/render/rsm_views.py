# SPDX-License-Identifier: GPL-3.0-or-later
"""Through what views a lamp's reflective shadow map is drawn: every direction that it shines in is in one texel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..core.scene import AREA, SPOT, SUN, Float64, Light
from .geometry import GpuGeometry
from .gpu_layout import CONSTANTS
from .passes.shadow_map import CUBE_FACES, CUBE_TILES, FRONT_FACE, NARROWEST_CONE, shadow_kind
from .view import View

# Nearest surface that a lamp sees, of the distance to the farthest.
NEAREST = 1e-6
# Around a sun's view of the scene, of its size, for what rounding may move out of it.
SUN_MARGIN = 1e-4
BACK_FACE = 4
"""Index of the face behind a lamp that shines along its -z axis only."""


@dataclass(frozen=True)
class FaceView:
    """One tile of a map. tile: its column and row. extent: half its size, at distance 1 or (SUN) in m."""

    view: View
    tile: tuple[int, int]
    extent: tuple[float, float]


def map_tiles(light: Light) -> tuple[int, int]:
    """Columns and rows of tiles in the maps of `light`."""
    return CUBE_TILES if shadow_kind(light) == "SHADOW_CUBE" else (1, 1)


def face_views(light: Light, record: np.ndarray, geometry: GpuGeometry, side: int) -> list[FaceView]:
    """The views of one map of `light`, `side` texels a face; fills the shadow_* fields of `record`."""
    record["shadow_kind"] = CONSTANTS[shadow_kind(light)]
    corners = np.array([np.where(bits, geometry.high, geometry.low) for bits in np.ndindex(2, 2, 2)])
    axes = np.array([record[name][0] for name in ("x_axis", "y_axis", "z_axis")], np.float64)
    if light.kind == SUN:
        return [_sun_view(record, corners, axes)]
    record["shadow_origin"] = record["sample_position"]
    origin = record["sample_position"][0].astype(np.float64)
    far = 2.0 * float(np.linalg.norm(corners - origin, axis=1).max())
    if shadow_kind(light) == "SHADOW_CONE":
        extent = np.maximum(math.tan(0.5 * light.spot_angle) * np.array(light.spot_scale), NARROWEST_CONE)
        faces = [FRONT_FACE]
    else:
        extent = np.ones(2)
        faces = [face for face in range(len(CUBE_FACES)) if face != BACK_FACE or light.kind not in (AREA, SPOT)]
    record["shadow_extent"] = extent
    half_x, half_y = extent.tolist()
    return [
        FaceView(_perspective(axes, face, extent, origin, far, side), _tile(light, face), (half_x, half_y))
        for face in faces
    ]


def _tile(light: Light, face: int) -> tuple[int, int]:
    return (0, 0) if map_tiles(light) == (1, 1) else (face % CUBE_TILES[0], face // CUBE_TILES[0])


def _perspective(axes: Float64, face: int, extent: Float64, origin: Float64, far: float, side: int) -> View:
    """View through a face; w of clip space is the distance along its axis."""
    axis, sign = CUBE_FACES[face]
    right, up, forward = axes[(axis + 1) % 3], axes[(axis + 2) % 3], sign * axes[axis]
    near = NEAREST * far
    matrix = np.zeros((4, 4))
    matrix[:, :3] = right / extent[0], up / extent[1], forward, forward
    matrix[:, 3] = -matrix[:, :3] @ origin
    matrix[2, 3] -= 2.0 * near
    corner = forward - extent[0] * right - extent[1] * up
    rays = np.array([corner, 2.0 * extent[0] / side * right, 2.0 * extent[1] / side * up])
    return View(matrix, origin, -forward, False, (near, far), rays)


def _sun_view(record: np.ndarray, corners: Float64, axes: Float64) -> FaceView:
    """View of the whole scene along a sun's rays."""
    middle = corners.mean(axis=0)
    record["shadow_origin"] = middle
    middle = record["shadow_origin"][0].astype(np.float64)
    seen = np.abs((corners - middle) @ axes.T).max(axis=0)
    half = np.maximum(seen, 1e-6 * max(float(seen.max()), 1e-30)) * (1.0 + SUN_MARGIN)
    record["shadow_extent"], record["shadow_centre"] = half[:2], np.zeros(2)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = axes / (half * (1.0, 1.0, -1.0))[:, None]
    matrix[:3, 3] = -matrix[:3, :3] @ middle
    matrix[3, 3] = 1.0
    half_x, half_y, half_z = half.tolist()
    view = View(matrix, middle + half_z * axes[2], axes[2], True, (0.0, 2.0 * half_z), np.zeros((3, 3)))
    return FaceView(view, (0, 0), (half_x, half_y))
