# SPDX-License-Identifier: GPL-3.0-or-later
"""The shapes of the drawing tools as points and corners: rectangles and strips along a path."""

from __future__ import annotations

import numpy as np

from ...core.errors import InvalidInput
from ...core.scene import Float64

Corners = list[list[int]]

START_SHARE = 1e-3
"""A path whose first point is within this share of the edge's half length of its middle begins there."""

BEND_COSINE = 0.85
"""Surfaces whose normals are less alike than this meet in a corner."""

ACROSS_COSINE = 0.5
"""Cosine between an edge and a corner from which the strip goes across it."""

MOST_ROWS = 16
"""Rows or columns of a grid: more take seconds to be laid on the surface."""

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


def strip(edge: Float64, path: Float64, normals: Float64) -> tuple[Float64, Corners, Float64]:
    """A strip of quads that the edge leaves as its middle goes along a path.

    edge: (2, 3). path: (n, 3) places of the middle; the first may be where it begins. normals: (n, 3) unit, of the
    surface there: the edge turns with it, so that it stays in the surface, and where the path goes round a corner the
    strip bends in it. Returns points (v, 3), the edge's first, corners of each quad, and (q, 3) where each faces.
    Raises InvalidInput for an edge or a path without length.
    """
    half = 0.5 * (edge[1] - edge[0])
    length = float(np.linalg.norm(half))
    if not length > 0.0:
        raise InvalidInput("edge", "its two ends are one", "give two points")
    middle, normal = edge.mean(axis=0), normals[0]
    points, facing = [edge[0], edge[1]], []
    for place, there in zip(path, normals, strict=True):
        if np.linalg.norm(place - middle) <= START_SHARE * length:
            normal = there
            continue
        bend = _corner(middle, normal, place, there, half) if normal @ there < BEND_COSINE else None
        if bend is not None:
            points += [bend[0] - bend[1], bend[0] + bend[1]]
            facing.append(normal)
            half = bend[1]
        half = _turned(half, there)
        points += [place - half, place + half]
        facing.append(there)
        middle, normal = place, there
    if not facing:
        raise InvalidInput("path", "it does not leave the edge", "give at least one point to extrude to")
    quads = [[2 * at, 2 * at + 1, 2 * at + 3, 2 * at + 2] for at in range(len(facing))]
    return np.array(points), quads, np.array(facing)


def _turned(half: Float64, normal: Float64) -> Float64:
    """`half` turned into the plane of `normal`, as long as it was."""
    turned = _in_plane(half, normal)
    return half if turned is None else float(np.linalg.norm(half)) * turned


def _corner(
    start: Float64, normal: Float64, end: Float64, other: Float64, half: Float64
) -> tuple[Float64, Float64] | None:
    """Middle and half edge in the line where the planes at both ends of a step meet; None where the strip does not go
    across it, or it is beside the way."""
    line = np.cross(normal, other)
    sine = float(np.linalg.norm(line))
    if sine == 0.0:
        return None
    line /= sine
    share = float(half @ line) / float(np.linalg.norm(half))
    if abs(share) < ACROSS_COSINE:
        return None
    rows = np.array([normal, other, line])
    middle = np.linalg.solve(rows, [normal @ start, other @ end, line @ (0.5 * (start + end))])
    step = float(np.linalg.norm(end - start))
    if max(np.linalg.norm(middle - start), np.linalg.norm(middle - end)) > step:
        return None
    return middle, np.sign(share) * float(np.linalg.norm(half)) * line


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
