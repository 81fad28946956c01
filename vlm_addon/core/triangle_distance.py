# SPDX-License-Identifier: GPL-3.0-or-later
"""Squared distances between points and triangles, many pairs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh_topology import Bool, Int64
from .scene import Float64

# Below this sine between its sides, a triangle is a segment: rounding decides where it faces.
LEAST_SINE = 1e-12


@dataclass(frozen=True)
class FlatTriangles:
    """Triangles, each in a frame of its own in which it is flat.

    origins: (n, 3) first corners, m. frames: (n, 3, 3) rows x, y, normal. flat: (n, 3, 2) corners in x and y. solid:
    (n,) bool, those with area.
    """

    origins: Float64
    frames: Float64
    flat: Float64
    solid: Bool

    def squared_distances(self, points: Float64, triangle: Int64) -> Float64:
        """(p,) squared distance in m² of each point (p, 3) to the triangle beside it."""
        offset = points - self.origins[triangle]
        x, y, height = np.einsum("ikj,ij->ki", self.frames[triangle], offset)
        flat = self.flat[triangle]
        best = np.full(len(points), np.inf)
        inside = self.solid[triangle]
        for corner in range(3):
            start, end = flat[:, corner], flat[:, (corner + 1) % 3]
            side_x, side_y = end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]
            from_x, from_y = x - start[:, 0], y - start[:, 1]
            square = side_x * side_x + side_y * side_y
            along = (from_x * side_x + from_y * side_y) / np.where(square > 0, square, 1.0)
            along = np.clip(along, 0.0, 1.0)
            best = np.minimum(best, (from_x - along * side_x) ** 2 + (from_y - along * side_y) ** 2)
            inside &= side_x * from_y - side_y * from_x >= 0
        return np.where(inside, 0.0, best) + height * height

    def nearest_points(self, points: Float64, triangle: Int64) -> Float64:
        """(p, 3) m: the point of each triangle that is nearest to the point beside it."""
        offset = points - self.origins[triangle]
        flat = self.flat[triangle]
        place = np.einsum("ikj,ij->ik", self.frames[triangle, :2], offset)
        best, nearest = np.full(len(points), np.inf), place.copy()
        inside = self.solid[triangle]
        for corner in range(3):
            start = flat[:, corner]
            side, way = flat[:, (corner + 1) % 3] - start, place - start
            square = np.einsum("ij,ij->i", side, side)
            along = np.einsum("ij,ij->i", way, side) / np.where(square > 0, square, 1.0)
            on_side = start + np.clip(along, 0.0, 1.0)[:, None] * side
            far = ((place - on_side) ** 2).sum(axis=1)
            nearest = np.where((far < best)[:, None], on_side, nearest)
            best = np.minimum(best, far)
            inside &= side[:, 0] * way[:, 1] - side[:, 1] * way[:, 0] >= 0
        nearest = np.where(inside[:, None], place, nearest)
        return self.origins[triangle] + np.einsum("ik,ikj->ij", nearest, self.frames[triangle, :2])


def flat_triangles(corners: Float64) -> FlatTriangles:
    """Of (n, 3, 3) corners, m; a triangle without area is the segment or point that it is."""
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(side, other)
    largest = np.maximum(np.einsum("ij,ij->i", side, side), np.einsum("ij,ij->i", other, other))
    degenerate = ~(np.linalg.norm(normal, axis=1) > LEAST_SINE * largest)
    longest = np.where((np.linalg.norm(side, axis=1) > 0)[:, None], side, other)
    longest[~longest.any(axis=1)] = [1.0, 0.0, 0.0]
    # Any frame that holds the segment will do.
    slanted = np.roll(longest[degenerate], 1, axis=1) + np.array([1.0, 2.0, 3.0])
    normal[degenerate] = np.cross(longest[degenerate], slanted)
    x_axis = _unit(longest)
    normal = _unit(normal)
    frames = np.stack([x_axis, np.cross(normal, x_axis), normal], axis=1)
    flat = np.einsum("nkj,ncj->nck", frames[:, :2], corners - corners[:, :1])
    return FlatTriangles(corners[:, 0], frames, flat, ~degenerate)


def _unit(vectors: Float64) -> Float64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
