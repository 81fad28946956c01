# SPDX-License-Identifier: GPL-3.0-or-later
"""Can anything in a scene stand between two points of its surfaces? Where it provably cannot, nobody need ask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .reach import Bools
from .scene import Float64, Mesh

MOST_PAIRS = 10_000_000
"""Of a triangle and a point that are looked at, some tenths of a second; scenes with more count as having occluders."""

MOST_PAIRS_FOR_EACH = 1_000_000
"""The same where each triangle is judged, some hundredths of a second: this may be done for every frame."""

_AT_ONCE = 1_000_000
_SLACK = 3e-7
"""Of the scene's diagonal, some roundings of a place in float32: a point so near to a plane is in it."""


@dataclass(frozen=True)
class Occlusion:
    """Whether something may stand between two surface points, and what decided that, as a sentence."""

    possible: bool
    reason: str


def find_occlusion(
    meshes: Sequence[Mesh], source_points: Float64 | None = None, source_directions: Float64 | None = None
) -> Occlusion:
    """Whether something of `meshes` may stand between two points of them, or between one and `source_points` (s, 3) or
    what lies infinitely far in `source_directions` (d, 3).

    Not so where every triangle has all points on one side of its plane, or in it: then all triangles are on the hull of
    the scene, and a segment between two points of a convex body does not leave it. That is a room without anything
    inside, a body alone, a plane. Raises nothing: what is not finite counts as an occluder.
    """
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    triangle_count = sum(len(mesh.triangles) for mesh in filled)
    if not triangle_count:
        return Occlusion(False, "nothing can occlude anything: there is no surface")
    points, slack = _all_points(filled, source_points)
    directions = np.zeros((0, 3)) if source_directions is None else source_directions
    left, at_once = MOST_PAIRS, max(_AT_ONCE // len(points), 1)
    for mesh in filled:
        corners = mesh.positions[mesh.triangles].astype(np.float64)
        for first in range(0, len(corners), at_once):
            if left <= 0:
                return Occlusion(True, f"{triangle_count:,} triangles may occlude each other: too many to compare all")
            if not _have_all_on_one_side(corners[first : first + at_once], points, directions, slack).all():
                return Occlusion(True, f"{mesh.name!r} has other surfaces on both sides and may stand between them")
            left -= at_once * len(points)
    text = f"each of the {triangle_count:,} triangles has the whole scene on one side"
    return Occlusion(False, f"nothing can occlude anything: {text}")


def occluding_triangles(
    meshes: Sequence[Mesh], occlusion: Occlusion, source_points: Float64, source_directions: Float64
) -> tuple[Bools, ...] | None:
    """Which triangles of each mesh may stand between a source and a surface point, as find_occlusion has it; None for
    all, where there are too many to compare.

    occlusion: what find_occlusion says of the same arguments. The others only end segments: a map of what a lamp sees
    need not hold them, and is exact next to walls without them.
    """
    if not occlusion.possible:
        return tuple(np.zeros(len(mesh.triangles), bool) for mesh in meshes)
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    points, slack = _all_points(filled, source_points)
    if sum(len(mesh.triangles) for mesh in filled) * len(points) > MOST_PAIRS_FOR_EACH:
        return None
    corners = (mesh.positions[mesh.triangles].astype(np.float64) for mesh in meshes)
    return tuple(~_have_all_on_one_side(triangles, points, source_directions, slack) for triangles in corners)


def _all_points(filled: Sequence[Mesh], source_points: Float64 | None) -> tuple[Float64, float]:
    """(p, 3) vertices in use and source points, each once, and how near to a plane a point is in it."""
    points = np.concatenate([mesh.positions[np.unique(mesh.triangles)] for mesh in filled]).astype(np.float64)
    if source_points is not None:
        points = np.concatenate([points, source_points])
    points = np.unique(points, axis=0)
    return points, _SLACK * float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


def _have_all_on_one_side(corners: Float64, points: Float64, directions: Float64, slack: float) -> Bools:
    """Which of (t, 3, 3) triangles have all of (p, 3) points, and all that lies far in (d, 3) directions, on one side
    of their plane, the points within `slack` of it.

    Triangles without area occlude nothing. False for what is not finite.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    heights = normals @ points.T - np.einsum("ij,ij->i", normals, a)[:, None]
    slopes = normals @ directions.T
    above = (heights >= -slack).all(axis=1) & (slopes >= 0.0).all(axis=1)
    below = (heights <= slack).all(axis=1) & (slopes <= 0.0).all(axis=1)
    return np.asarray((lengths == 0.0) | above | below)
