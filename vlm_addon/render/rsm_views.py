# SPDX-License-Identifier: GPL-3.0-or-later
"""Through what views a lamp's reflective shadow map is drawn: every direction that it shines in is in one texel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..core.scene import AREA, POINT, SPOT, SUN, Float64, Light
from .geometry import GpuGeometry
from .gpu_layout import CONSTANTS
from .shadow_views import CUBE_FACES, CUBE_TILES, FRONT_FACE, NARROWEST_CONE, shadow_kind
from .view import View

# Nearest surface that a lamp sees, of the distance to the farthest.
NEAREST = 1e-6
# Around the scene's bounds, of their distance or size, for what rounding may move out of them.
MARGIN = 1e-3
# A lamp that sees the whole scene within this tangent to each side of its middle needs no cube around it.
WIDEST_TANGENT = 1.0
BACK_FACE = 4
"""Index of the face behind a lamp that shines along its -z axis only."""


@dataclass(frozen=True)
class FaceView:
    """One tile of a map. tile: its column and row. extent, centre: half its size and its middle, on the plane at
    distance 1 or (SUN) in m."""

    view: View
    tile: tuple[int, int]
    extent: tuple[float, float]
    centre: tuple[float, float]


def map_kind(light: Light, geometry: GpuGeometry) -> str:
    """Name of the projection of a lamp's maps, among gpu_layout.CONSTANTS: that of its shadow maps, but a POINT lamp
    that has all of the scene on one side looks there only."""
    if light.kind != POINT:
        return shadow_kind(light)
    origin = np.array(light.position) - geometry.origin
    seen = (_corners(geometry) - origin) @ _towards_middle(geometry, origin).T
    tangents = np.abs(seen[:, :2]) <= WIDEST_TANGENT * -seen[:, 2:]
    return "SHADOW_CONE" if tangents.all() and (seen[:, 2] < 0.0).all() else "SHADOW_CUBE"


def map_tiles(light: Light, geometry: GpuGeometry) -> tuple[int, int]:
    """Columns and rows of tiles in the maps of `light`."""
    return CUBE_TILES if map_kind(light, geometry) == "SHADOW_CUBE" else (1, 1)


def face_views(light: Light, record: np.ndarray, geometry: GpuGeometry, side: int) -> list[FaceView]:
    """The views of one map of `light`, `side` texels a face, that can show something; fills the shadow_* fields of
    `record`, and the axes of a POINT lamp, which has no others."""
    kind = map_kind(light, geometry)
    record["shadow_kind"] = CONSTANTS[kind]
    corners = _corners(geometry)
    if light.kind == SUN:
        return [_sun_view(record, corners, _axes(record))]
    record["shadow_origin"] = record["sample_position"]
    origin = record["sample_position"][0].astype(np.float64)
    record["shadow_extent"] = 1.0
    if kind == "SHADOW_CONE":
        if light.kind == POINT:
            record["x_axis"], record["y_axis"], record["z_axis"] = _towards_middle(geometry, origin)
        seen = (corners - origin) @ _axes(record).T
        _fit_cone(light, record, seen)
        faces = [FRONT_FACE]
    else:
        faces = [face for face in range(len(CUBE_FACES)) if face != BACK_FACE or light.kind not in (AREA, SPOT)]
    extent, centre = (record[name][0].astype(np.float64) for name in ("shadow_extent", "shadow_centre"))
    views = []
    for face in faces:
        axis, sign = CUBE_FACES[face]
        depths = sign * ((corners - origin) @ _axes(record)[axis])
        if depths.max() > 0.0:
            view = _perspective(_axes(record), face, extent, centre, origin, depths, side)
            tile = (face % CUBE_TILES[0], face // CUBE_TILES[0]) if kind == "SHADOW_CUBE" else (0, 0)
            views.append(FaceView(view, tile, _pair(extent), _pair(centre)))
    return views


def _pair(values: Float64) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _axes(record: np.ndarray) -> Float64:
    return np.array([record[name][0] for name in ("x_axis", "y_axis", "z_axis")], np.float64)


def _corners(geometry: GpuGeometry) -> Float64:
    return np.array([np.where(bits, geometry.high, geometry.low) for bits in np.ndindex(2, 2, 2)])


def _towards_middle(geometry: GpuGeometry, origin: Float64) -> Float64:
    """Rows: x, y and z axis of a lamp at `origin` that shines towards the middle of the scene."""
    backward = origin - 0.5 * (geometry.low + geometry.high)
    length = float(np.linalg.norm(backward))
    z_axis = backward / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x_axis = np.cross(np.eye(3)[np.argmin(np.abs(z_axis))], z_axis)
    x_axis /= np.linalg.norm(x_axis)
    return np.array([x_axis, np.cross(z_axis, x_axis), z_axis])


def _fit_cone(light: Light, record: np.ndarray, seen: Float64) -> None:
    """Confines the one tile to the part of the lamp's cone that the scene's corners reach into. seen: in its frame."""
    low, high = np.full(2, -WIDEST_TANGENT), np.full(2, WIDEST_TANGENT)
    if light.kind == SPOT:
        high = np.maximum(math.tan(0.5 * light.spot_angle) * np.array(light.spot_scale), NARROWEST_CONE)
        low = -high
    if (seen[:, 2] < 0.0).all():
        places = seen[:, :2] / -seen[:, 2:]
        margin = MARGIN * np.ptp(places, axis=0) + NARROWEST_CONE
        fitted_low = np.maximum(low, places.min(axis=0) - margin)
        fitted_high = np.minimum(high, places.max(axis=0) + margin)
        # Where the scene lies beside the cone, any view of it shows nothing that is lit.
        if (fitted_low < fitted_high).all():
            low, high = fitted_low, fitted_high
    record["shadow_extent"], record["shadow_centre"] = 0.5 * (high - low), 0.5 * (high + low)


def _perspective(
    axes: Float64, face: int, extent: Float64, centre: Float64, origin: Float64, depths: Float64, side: int
) -> View:
    """View through a face; w of clip space is the distance along its axis. depths: of the scene's corners."""
    axis, sign = CUBE_FACES[face]
    right, up, forward = axes[(axis + 1) % 3], axes[(axis + 2) % 3], sign * axes[axis]
    far = (1.0 + MARGIN) * float(depths.max())
    near = max(NEAREST * far, (1.0 - MARGIN) * float(depths.min()))
    matrix = np.zeros((4, 4))
    matrix[0, :3], matrix[1, :3] = (right - centre[0] * forward) / extent[0], (up - centre[1] * forward) / extent[1]
    matrix[2, :3] = matrix[3, :3] = forward
    matrix[:, 3] = -matrix[:, :3] @ origin
    matrix[2, 3] -= 2.0 * near
    corner = forward + (centre[0] - extent[0]) * right + (centre[1] - extent[1]) * up
    rays = np.array([corner, 2.0 * extent[0] / side * right, 2.0 * extent[1] / side * up])
    return View(matrix, origin, -forward, False, (near, far), rays)


def _sun_view(record: np.ndarray, corners: Float64, axes: Float64) -> FaceView:
    """View of the whole scene along a sun's rays."""
    record["shadow_origin"] = corners.mean(axis=0)
    middle = record["shadow_origin"][0].astype(np.float64)
    seen = np.abs((corners - middle) @ axes.T).max(axis=0)
    half = np.maximum(seen, 1e-6 * max(float(seen.max()), 1e-30)) * (1.0 + MARGIN)
    record["shadow_extent"], record["shadow_centre"] = half[:2], np.zeros(2)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = axes / (half * (1.0, 1.0, -1.0))[:, None]
    matrix[:3, 3] = -matrix[:3, :3] @ middle
    matrix[3, 3] = 1.0
    half_z = float(half[2])
    view = View(matrix, middle + half_z * axes[2], axes[2], True, (0.0, 2.0 * half_z), np.zeros((3, 3)))
    return FaceView(view, (0, 0), _pair(half), (0.0, 0.0))
