# SPDX-License-Identifier: GPL-3.0-or-later
"""Evenly spread places in a reflective shadow map, and which texels they are in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.halton import halton_points
from ..core.mesh_topology import Bool
from ..core.scene import Float64, Int32
from ..core.vpl_placement import ConePoints
from .gpu_layout import CONSTANTS
from .shadow_views import CUBE_TILES


@dataclass(frozen=True)
class MapPlaces:
    """texels: (n, 2) int32, column and row in the map. shares: (n,) float64, how many such texels each stands for."""

    texels: Int32
    shares: Float64


class PlacesOnSphere:
    """Places in the map of a lamp that shines from a point: directions in its cone (seed 001, 3.1)."""

    def __init__(self, record: np.ndarray, side: int, first: int) -> None:
        """record, side: of the ReflectiveShadowMap. first: of the points that can be in the cone."""
        self._record = record[0]
        self._side = side
        self._is_cube = int(self._record["shadow_kind"]) == CONSTANTS["SHADOW_CUBE"]
        self._extent, self._centre = (self._record[name].astype(float) for name in ("shadow_extent", "shadow_centre"))
        self._points = ConePoints(self._cos_half(), self._accepts, first)

    def take(self, count: int) -> MapPlaces:
        """The next `count` places."""
        directions = self._points.take(count)
        if not len(directions):
            return MapPlaces(np.zeros((0, 2), np.int32), np.zeros(0))
        tiles, planes = self._cube_faces(directions) if self._is_cube else self._cone_face(directions)
        texels = np.clip((0.5 * (planes - self._centre) / self._extent + 0.5) * self._side, 0, self._side - 1)
        texel_size = 2.0 * self._extent / self._side
        # A piece of a plane at distance 1 fills its area over the cube of the distance.
        solid_angles = texel_size.prod() * (1.0 + (planes**2).sum(axis=1)) ** -1.5
        shares = self._points.solid_angle / len(directions) / solid_angles
        return MapPlaces((tiles * self._side + texels.astype(np.int32)).astype(np.int32), shares)

    def _accepts(self, directions: Float64) -> Bool:
        accepted = np.ones(len(directions), bool)
        kind = int(self._record["kind"])
        if not self._is_cube:
            _, planes = self._cone_face(directions)
            accepted &= (directions[:, 2] < 0.0) & (np.abs(planes - self._centre) <= self._extent).all(axis=1)
        if kind == CONSTANTS["LAMP_AREA"]:
            accepted &= directions[:, 2] < 0.0
        if kind == CONSTANTS["LAMP_SPOT"]:
            local = directions / np.append(self._record["spot_scale"].astype(float), 1.0)
            accepted &= -local[:, 2] >= self._record["spot_cos_half"] * np.linalg.norm(local, axis=1)
        return accepted

    def _cos_half(self) -> float:
        """Of a cone around all that is accepted."""
        farthest = -1.0
        if not self._is_cube:
            farthest = (1.0 + ((np.abs(self._centre) + self._extent) ** 2).sum()) ** -0.5
        cos_half = float(self._record["spot_cos_half"])
        if int(self._record["kind"]) == CONSTANTS["LAMP_SPOT"] and 0.0 < cos_half < 1.0:
            tangent = np.sqrt(1.0 - cos_half**2) / cos_half * float(self._record["spot_scale"].max())
            farthest = max(farthest, (1.0 + tangent**2) ** -0.5)
        return float(farthest)

    def _cone_face(self, directions: Float64) -> tuple[Float64, Float64]:
        return np.zeros((len(directions), 2)), directions[:, :2] / np.maximum(-directions[:, 2:], 1e-9)

    def _cube_faces(self, directions: Float64) -> tuple[Float64, Float64]:
        """Column and row of the tile that shows each direction, and where on the plane at distance 1."""
        axis = np.argmax(np.abs(directions), axis=1)
        rows = np.arange(len(directions))
        along = directions[rows, axis]
        planes = np.stack([directions[rows, (axis + turn) % 3] for turn in (1, 2)], axis=1) / np.abs(along)[:, None]
        face = 2 * axis + (along < 0.0)
        return np.stack([face % CUBE_TILES[0], face // CUBE_TILES[0]], axis=1), planes


class PlacesOnPlane:
    """Places in the map of a sun: all of it is lit alike."""

    def __init__(self, side: int, first: int) -> None:
        self._side = side
        self._first = first

    def take(self, count: int) -> MapPlaces:
        """The next `count` places."""
        texels = (halton_points(count, self._first) * self._side).astype(np.int32)
        self._first += count
        return MapPlaces(texels, np.full(count, self._side**2 / max(count, 1)))


Places = PlacesOnSphere | PlacesOnPlane


def places_in(record: np.ndarray, side: int, first: int = 1) -> Places:
    """Places in the map with this record and so many texels along a face, from the `first` of the sequence on."""
    if int(record["shadow_kind"][0]) == CONSTANTS["SHADOW_PARALLEL"]:
        return PlacesOnPlane(side, first)
    return PlacesOnSphere(record, side, first)
