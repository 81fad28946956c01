# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines that show what lights do: outlines of faces, the side that shines, and how far they reach."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .scene import Float64, Int32

Int64 = npt.NDArray[np.int64]

NORMAL_LENGTH = 0.35
"""Of the line that shows which side shines, in square roots of its face's area."""
_ARC_STEPS = 32


def outlines(corners: Float64, faces: Int32) -> Float64:
    """(l, 2, 3): edges of faces, without those between triangles of one face; edges of neighbours once.

    corners: (t, 3, 3). faces: (t,) the face of each triangle.
    """
    if not len(corners):
        return np.zeros((0, 2, 3))
    triangles = _same_places(corners.reshape(-1, 3)).reshape(-1, 3)
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    places = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    count = int(triangles.max()) + 1
    _, edge = np.unique(edges.min(axis=1) * count + edges.max(axis=1), return_inverse=True)
    owned = np.repeat(faces.astype(np.int64), 3) * (int(edge.max()) + 1) + edge
    _, within, uses = np.unique(owned, return_inverse=True, return_counts=True)
    rim = uses[within] == 1
    _, first = np.unique(edge[rim], return_index=True)
    return np.asarray(places[rim][first])


def _same_places(points: Float64) -> Int64:
    """(n,) a number for each of (n, 3) points, the same for points that are the same."""
    order = np.lexsort(points.T)
    is_new = np.append(True, (np.diff(points[order], axis=0) != 0.0).any(axis=1))
    numbers = np.empty(len(points), np.int64)
    numbers[order] = np.cumsum(is_new) - 1
    return numbers


def normal_lines(middles: Float64, normals: Float64, areas: Float64) -> Float64:
    """(n, 2, 3): from the middle of each face to its shining side. middles, normals (unit): (n, 3). areas: (n,) m²."""
    ends = middles + NORMAL_LENGTH * np.sqrt(areas)[:, None] * normals
    return np.stack([middles, ends], axis=1)


def half_ball_lines(centres: Float64, normals: Float64, radii: Float64) -> Float64:
    """(l, 2, 3): for each half ball the circle of its plane and two arcs across.

    centres, normals (unit, towards the lit side): (n, 3). radii: (n,) m.
    """
    first, second = _plane_axes(normals)
    full = np.linspace(0.0, 2.0 * np.pi, 2 * _ARC_STEPS + 1)
    half = np.linspace(0.0, np.pi, _ARC_STEPS + 1)
    ways = [_way(first, second, full), _way(first, normals, half), _way(second, normals, half)]
    lines = [np.stack([way[:, :-1], way[:, 1:]], axis=2) for way in ways]
    unit = np.concatenate(lines, axis=1)
    return np.asarray(centres[:, None, None] + radii[:, None, None, None] * unit).reshape(-1, 2, 3)


def box_lines(corners: Float64) -> Float64:
    """(12 c, 2, 3): edges of boxes. corners: (c, 2, 3) lower and upper."""
    lines = []
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        for first in (0, 1):
            for second in (0, 1):
                start = corners[:, 0].copy()
                start[:, across[0]], start[:, across[1]] = corners[:, first, across[0]], corners[:, second, across[1]]
                end = start.copy()
                end[:, axis] = corners[:, 1, axis]
                lines.append(np.stack([start, end], axis=1))
    return np.concatenate(lines) if len(corners) else np.zeros((0, 2, 3))


def _plane_axes(normals: Float64) -> tuple[Float64, Float64]:
    """Two unit vectors across each normal, (n, 3) each."""
    aside = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, aside)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.finfo(float).tiny)
    return first, np.cross(normals, first)


def _way(first: Float64, second: Float64, angles: Float64) -> Float64:
    """(n, angles, 3): along a circle from `first` over `second`."""
    return first[:, None] * np.cos(angles)[:, None] + second[:, None] * np.sin(angles)[:, None]
