# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that are about to become lights: checked, turned to the side they shall light, cut where they are not flat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mathutils import Vector
from mathutils.geometry import tessellate_polygon

from ...core.errors import InvalidInput
from ...core.scene import Float64

FLAT_SHARE = 1e-4
"""A face is flat where no corner is farther off its mean plane than this share of its size; other faces are cut into
triangles, since each light has one plane."""

LEAST_AREA_SHARE = 1e-9
"""Area of a face as a share of the square of its extent, below which it is a line."""


@dataclass(frozen=True)
class Faces:
    """points: (v, 3) float64, m, world. corners: indices into points of each face, anticlockwise from the side that it
    lights."""

    points: Float64
    corners: tuple[tuple[int, ...], ...]


def faces_of(points: Float64, corners: Sequence[Sequence[int]], normals: Float64) -> Faces:
    """Faces over `points`, turned to face as `normals` do; those that are not flat become triangles.

    normals: (f, 3), the side that each face shall light; zero keeps the order of its corners. Raises InvalidInput for
    a face without area.
    """
    made: list[tuple[int, ...]] = []
    for face, wanted in zip(corners, normals, strict=True):
        ring = tuple(face)
        normal, area = plane_of(points[list(ring)])
        extent = float(np.ptp(points[list(ring)], axis=0).max())
        if not area > LEAST_AREA_SHARE * extent**2:
            problem = f"its {len(ring)} points lie in a line or cross over to no area"
            raise InvalidInput("polygon", problem, "give at least three points around an area")
        if normal @ wanted < 0.0:
            ring, normal = ring[::-1], -normal
        made += [ring] if _is_flat(points[list(ring)], normal, area) else _triangles(points, ring, normal)
    return Faces(points, tuple(made))


def plane_of(ring: Float64) -> tuple[Float64, float]:
    """Unit normal and area of a polygon, by Newell's method; (k, 3) corners. The normal of no area is zero."""
    centred = ring - ring.mean(axis=0)
    vector = 0.5 * np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    area = float(np.linalg.norm(vector))
    return (vector / area if area > 0.0 else vector), area


def triangles_of(faces: Faces) -> tuple[np.ndarray, np.ndarray]:
    """(t, 3) int64 corners of the triangles that the faces consist of, and (t,) the face of each."""
    triangles: list[tuple[int, ...]] = []
    owners: list[int] = []
    for number, ring in enumerate(faces.corners):
        cut = [ring] if len(ring) == 3 else _triangles(faces.points, ring, plane_of(faces.points[list(ring)])[0])
        triangles += cut
        owners += [number] * len(cut)
    return np.array(triangles, np.int64).reshape(-1, 3), np.array(owners, np.int64)


def _is_flat(ring: Float64, normal: Float64, area: float) -> bool:
    heights = (ring - ring.mean(axis=0)) @ normal
    return len(ring) == 3 or bool(np.abs(heights).max() <= FLAT_SHARE * np.sqrt(area))


def _triangles(points: Float64, ring: tuple[int, ...], normal: Float64) -> list[tuple[int, ...]]:
    corners = [points[corner] - points[ring[0]] for corner in ring]
    cut = [tuple(ring[index] for index in triangle) for triangle in tessellate_polygon([[Vector(c) for c in corners]])]
    turned = []
    for triangle in cut:
        a, b, c = points[list(triangle)]
        vector = np.cross(b - a, c - a)
        if np.linalg.norm(vector) > 0.0:
            turned.append(triangle if vector @ normal > 0.0 else triangle[::-1])
    return turned
