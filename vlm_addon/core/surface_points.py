# SPDX-License-Identifier: GPL-3.0-or-later
"""Random points of the visible surface, where a structure over the lights is judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .errors import InvalidInput
from .sampling import square_to_triangle
from .scene import Float64, Int32, Mesh


@dataclass(frozen=True)
class SurfacePoints:
    """positions: (p, 3) float64, m. normals: (p, 3) float64 unit, of the faces. tag_ids: (p,) int32."""

    positions: Float64
    normals: Float64
    tag_ids: Int32


NO_POINTS = SurfacePoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int32))


def require_points(points: SurfacePoints) -> SurfacePoints:
    """The same points. Raises InvalidInput where they are not SurfacePoints, or not finite rows of three each."""
    remedy = "give SurfacePoints, as random_surface_points makes them"
    if not isinstance(points, SurfacePoints):
        raise InvalidInput("surface points", f"they are of type {type(points).__name__}", remedy)
    count = len(points.tag_ids)
    for name in ("positions", "normals"):
        values = getattr(points, name)
        if np.shape(values) != (count, 3):
            problem = f"{name} of shape {np.shape(values)} for {count} tags"
            raise InvalidInput("surface points", problem, remedy)
        if not np.isfinite(values).all():
            raise InvalidInput("surface points", f"{name} that are not finite", remedy)
    return points


def random_surface_points(meshes: Sequence[Mesh], count: int, seed: int = 0) -> SurfacePoints:
    """`count` points that are uniform over the area of all triangles; none where nothing has area."""
    empty = np.zeros((0, 3, 3)), np.zeros(0, np.int32)
    parts = [(mesh.positions[mesh.triangles], mesh.tag_ids) for mesh in meshes] or [empty]
    corners, tag_ids = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_areas = np.linalg.norm(normals, axis=1)
    total = double_areas.sum()
    if not total > 0.0:
        return NO_POINTS
    random = np.random.default_rng(seed)
    chosen = random.choice(len(corners), count, p=double_areas / total)
    weights = square_to_triangle(random.random(count), random.random(count))
    positions = np.einsum("pk,pkj->pj", weights, corners[chosen])
    return SurfacePoints(positions, normals[chosen] / double_areas[chosen, None], tag_ids[chosen])
