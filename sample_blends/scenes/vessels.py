# SPDX-License-Identifier: GPL-3.0-or-later
"""A tea pot made on the lathe, with a bent tube for spout and handle. Pure geometry, metres, z up."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .shapes import Points, Shape, grid_faces, join, lathe, scaled, shape

# Radius and height of the pot's outline from the middle of the foot to the tip of the lid's knob, in units of its
# widest radius; knots of a smooth curve, doubled where the outline has an edge.
OUTLINE = (
    ((0.0, 0.0), (0.30, 0.0), (0.56, 0.0), (0.60, 0.02)),
    ((0.60, 0.02), (0.62, 0.06), (0.72, 0.14), (0.90, 0.34), (1.0, 0.62), (0.94, 0.90), (0.78, 1.12), (0.62, 1.24)),
    ((0.62, 1.24), (0.66, 1.27), (0.66, 1.31), (0.60, 1.33)),
    ((0.60, 1.33), (0.52, 1.37), (0.36, 1.44), (0.16, 1.49), (0.09, 1.53)),
    ((0.09, 1.53), (0.09, 1.56), (0.16, 1.62), (0.17, 1.69), (0.10, 1.75), (0.0, 1.77)),
)
POINTS_PER_RUN = (4, 18, 6, 11, 12)
SPOUT = ((0.72, 0.42), (1.12, 0.52), (1.32, 0.82), (1.46, 1.10), (1.66, 1.22))
SPOUT_RADII = (0.27, 0.20, 0.135, 0.105, 0.10)
HANDLE = ((-0.80, 1.06), (-1.18, 1.16), (-1.48, 1.02), (-1.50, 0.72), (-1.26, 0.46), (-0.90, 0.36))
HANDLE_RADII = (0.075, 0.075, 0.085, 0.085, 0.075, 0.065)


def smooth_curve(knots: npt.ArrayLike, count: int) -> Points:
    """`count` points, even in the parameter, on the Catmull-Rom spline through the knots, ends included."""
    points = np.asarray(knots, float)
    padded = np.concatenate([[2 * points[0] - points[1]], points, [2 * points[-1] - points[-2]]])
    position = np.linspace(0, len(points) - 1, count)
    span = np.minimum(position.astype(int), len(points) - 2)
    t = (position - span)[:, None]
    a, b, c, d = (padded[span + i] for i in range(4))
    return 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)


def tube(path: Points, radii: Points, segments: int, steps: int) -> Shape:
    """A closed round tube along a path (k, 2) in the plane of x and z, smooth through its knots."""
    centres, radius = smooth_curve(path, steps + 1), smooth_curve(np.asarray(radii)[:, None], steps + 1)[:, 0]
    tangents = np.gradient(centres, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    angles = np.arange(segments) * (2 * np.pi / segments)
    across = np.stack([-tangents[:, 1], np.zeros(len(centres)), tangents[:, 0]], axis=1)
    middle = np.stack([centres[:, 0], np.zeros(len(centres)), centres[:, 1]], axis=1)
    rings = (
        middle[:, None]
        + radius[:, None, None] * np.cos(angles)[:, None] * across[:, None]
        + radius[:, None, None] * np.sin(angles)[:, None] * np.array([0.0, -1.0, 0.0])
    )
    first, last = tuple(range(segments))[::-1], tuple(range(steps * segments, (steps + 1) * segments))
    return shape(rings.reshape(-1, 3), [*grid_faces(segments, steps, closed=True), first, last], smooth=True)


def tea_pot(radius: float, segments: int = 54) -> Shape:
    """A pot with lid, spout (+x) and handle (-x), standing on z = 0; each of its three parts is a closed surface."""
    outline = np.concatenate(
        [
            smooth_curve(run, count)[min(index, 1) :]
            for index, (run, count) in enumerate(zip(OUTLINE, POINTS_PER_RUN, strict=True))
        ]
    )
    outline[0, 0] = outline[-1, 0] = 0.0
    spout = tube(np.array(SPOUT), np.array(SPOUT_RADII), 20, 20)
    handle = tube(np.array(HANDLE), np.array(HANDLE_RADII), 15, 27)
    return scaled(join([lathe(outline, segments), spout, handle]), radius)
