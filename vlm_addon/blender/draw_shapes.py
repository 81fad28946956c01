# SPDX-License-Identifier: GPL-3.0-or-later
"""The shapes of the drawing tools as points and corners: rectangles and strips along a path."""

from __future__ import annotations

import numpy as np

from ..core.errors import InvalidInput
from ..core.scene import Float64

Corners = list[list[int]]

UPRIGHT = 0.9
"""Cosine with the world's z from which a surface counts as lying, so that its rectangles are aligned with x."""


def rectangle(
    first: Float64, opposite: Float64, normal: Float64, along: Float64, columns: int, rows: int
) -> tuple[Float64, Corners]:
    """A grid of columns x rows rectangles in the plane through `first`: points (v, 3) and corners of each.

    first, opposite: (3,) corners, m; normal: (3,) unit; along: (3,) direction of the columns, any if zero. The second
    corner is taken into the plane. Raises InvalidInput for a rectangle without area.
    """
    axis = _in_plane(along, normal)
    if axis is None:
        level = np.array([1.0, 0.0, 0.0]) - normal[0] * normal if abs(normal[2]) > UPRIGHT else _level(normal)
        axis = level / np.linalg.norm(level)
    across = np.cross(normal, axis)
    width, height = float((opposite - first) @ axis), float((opposite - first) @ across)
    if not width * height:
        raise InvalidInput("rectangle", "its corners lie on one line", "give two corners that are opposite")
    u, v = np.meshgrid(np.linspace(0.0, width, columns + 1), np.linspace(0.0, height, rows + 1))
    points = np.asarray(first + u.reshape(-1, 1) * axis + v.reshape(-1, 1) * across, np.float64)
    starts = [row * (columns + 1) + column for row in range(rows) for column in range(columns)]
    return points, [[at, at + 1, at + columns + 2, at + columns + 1] for at in starts]


def strip(edge: Float64, path: Float64, normals: Float64) -> tuple[Float64, Corners]:
    """A strip of quads that the edge leaves as its middle goes along a path: points (v, 3), the edge's first, and
    corners of each quad.

    edge: (2, 3). path: (n, 3) places of the middle. normals: (n, 3) of the surface there: the edge turns with it, so
    that it stays in the surface. Raises InvalidInput for a path that stays where it is.
    """
    half = 0.5 * (edge[1] - edge[0])
    length = float(np.linalg.norm(half))
    if not length > 0.0:
        raise InvalidInput("edge", "its two ends are one", "give two points")
    points = [edge[0], edge[1]]
    for middle, normal in zip(path, normals, strict=True):
        turned = _in_plane(half, normal)
        half = half if turned is None else length * turned
        points += [middle - half, middle + half]
    if len(points) == 2:
        raise InvalidInput("path", "it has no points", "give at least one to extrude to")
    return np.array(points), [[2 * at, 2 * at + 1, 2 * at + 3, 2 * at + 2] for at in range(len(path))]


def simplified(outline: Float64, tolerance: float) -> list[int]:
    """Rows of a closed outline, (n, 2), that keep it within `tolerance` (Ramer 1972, Douglas and Peucker 1973)."""
    far = int(np.argmax(((outline - outline[0]) ** 2).sum(axis=1)))
    closed = np.concatenate([outline, outline[:1]])
    kept = {0, far}
    spans = [(0, far), (far, len(outline))]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        way = closed[last] - closed[first]
        length = float(np.linalg.norm(way))
        offsets = closed[first + 1 : last] - closed[first]
        across = np.abs(way[0] * offsets[:, 1] - way[1] * offsets[:, 0]) / length if length else _lengths(offsets)
        row = int(np.argmax(across))
        if across[row] > tolerance:
            kept.add(first + 1 + row)
            spans += [(first, first + 1 + row), (first + 1 + row, last)]
    return sorted(kept)


def way_in_steps(points: Float64, step: float) -> list[int]:
    """Rows of (n, 3) points along a way that are about `step` apart, the last among them and the first not."""
    kept, last = [], 0
    for row in range(1, len(points)):
        if np.linalg.norm(points[row] - points[last]) >= step:
            kept.append(row)
            last = row
    end = len(points) - 1
    if last == end or end < 1:
        return kept
    if kept and np.linalg.norm(points[end] - points[last]) < 0.5 * step:
        kept[-1] = end
        return kept
    return [*kept, end]


def _lengths(vectors: Float64) -> Float64:
    return np.asarray(np.linalg.norm(vectors, axis=1), np.float64)


def _level(normal: Float64) -> Float64:
    """A horizontal direction in an upright plane."""
    return np.array([-normal[1], normal[0], 0.0])


def _in_plane(direction: Float64, normal: Float64) -> Float64 | None:
    """The unit vector of `direction` within the plane, None where it has no part in it."""
    part = np.asarray(direction, np.float64) - float(np.dot(direction, normal)) * normal
    length = float(np.linalg.norm(part))
    return part / length if length > 1e-6 * max(float(np.linalg.norm(direction)), 1e-30) else None
