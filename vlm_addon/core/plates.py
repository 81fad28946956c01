# SPDX-License-Identifier: GPL-3.0-or-later
"""Flat polygons of lights move back as a whole: a drawn quad stays flat, and a grid of them in one plane does.

A plate is all lights of one plane that hang together and contain a polygon of more than one triangle. Its plane goes
back along its normal; a vertex of several plates goes to where their planes meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .light_regions import facing
from .mesh_topology import Bool, Int64, Rows, connected_components, unit_normals
from .placement import STEEPEST_COSINE, THICKNESS_SHARE, insets
from .scene import Float64
from .triangle_tree import TriangleTree

# Lights are of one plane where their normals and their vertices differ by no more than this, in sizes of a light.
SAME_PLANE = 1e-4
# Plates that meet at a smaller angle go back by the same way: where their planes meet would be far to the side.
LEAST_ANGLE_COSINE = 0.87
# Of the way back, how far a vertex may stay off one of its planes.
OFF_PLANE = 1e-3
# What is no further behind its surface than so many insets is not looked at for the thickness of the body.
INSETS_UNSEEN = 2.0
# In insets.
LEAST_WAY = 1e-3


@dataclass(frozen=True)
class Plates:
    """of_light: (n,) int64, the plate of each light, -1 for none. count: how many."""

    of_light: Int64
    count: int


def find_plates(positions: Float64, triangles: Int64, polygons: Int64) -> Plates:
    """The plates of lights. polygons: (n,) int64, a number of the polygon that each light is part of."""
    corners = positions[triangles]
    normals = unit_normals(corners)
    one, other = _neighbours(triangles)
    sizes = np.sqrt(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1))
    off = np.abs(np.einsum("ikj,ij->ik", corners[other] - corners[one, :1], normals[one])).max(axis=1, initial=0.0)
    flat = (np.einsum("ij,ij->i", normals[one], normals[other]) > 1.0 - SAME_PLANE) & (
        off <= SAME_PLANE * np.maximum(sizes[one], sizes[other])
    )
    _, polygon, members = np.unique(polygons, return_inverse=True, return_counts=True)
    first = np.unique(polygon, return_index=True)[1][polygon]
    # A polygon is one plate however bent it is.
    row = np.arange(len(triangles))
    count, group = connected_components(
        len(triangles), np.concatenate([one[flat], row]), np.concatenate([other[flat], first])
    )
    holds = np.bincount(group, weights=members[polygon] > 1, minlength=count) > 0
    number = np.where(holds, np.cumsum(holds) - 1, -1)
    return Plates(number[group], int(holds.sum()))


def _neighbours(triangles: Int64) -> tuple[Int64, Int64]:
    """Pairs of triangles that follow each other around a common vertex."""
    order = np.argsort(triangles.ravel(), kind="stable")
    vertex, triangle = triangles.ravel()[order], order // 3
    same = np.flatnonzero(vertex[1:] == vertex[:-1])
    return triangle[same], triangle[same + 1]


def plates_behind(
    positions: Float64, triangles: Int64, plates: Plates, regions: Rows, corners: Float64, tree: TriangleTree
) -> tuple[Float64, Bool]:
    """(positions (v, 3) m, (v,) which vertices are of plates): plates moved back behind the regions of their lights.

    regions: rows of corners (k, 3, 3) for each light; a plate without any stays. No plate goes further into the body
    than the share of its thickness that placement.py allows, and none bends: where planes do not meet in a point, the
    plates that hang together stay. tree: of the visible surface.
    """
    held = np.zeros(len(positions), bool)
    held[triangles[plates.of_light >= 0]] = True
    way = _ways(positions[triangles], plates, regions, corners, tree)
    if not way.any():
        return positions, held
    normals = _mean_normals(positions[triangles], plates)
    pairs = _vertices_of(triangles, plates)
    groups = np.arange(plates.count)
    moved = positions.copy()
    for joined in (_alike(pairs, normals), _touching(pairs)):
        groups = connected_components(plates.count, *joined)[1]
        together = np.zeros(plates.count)
        np.maximum.at(together, groups, way)
        steps, off = _steps(pairs, normals, together[groups], len(positions))
        bent = np.zeros(plates.count, bool)
        bent[pairs[1][off[pairs[0]] > OFF_PLANE * together.max()]] = True
        moved = positions + steps
        if not bent.any():
            return moved, held
    whole = np.isin(groups, groups[bent])
    stays = np.zeros(len(positions), bool)
    stays[pairs[0][whole[pairs[1]]]] = True
    moved[stays] = positions[stays]
    return moved, held


def _ways(lights: Float64, plates: Plates, regions: Rows, corners: Float64, tree: TriangleTree) -> Float64:
    """(plates,) m: how far each has to go back, and may."""
    normals = _mean_normals(lights, plates)
    regions = facing(corners, regions, lights, STEEPEST_COSINE)
    owner = np.repeat(np.arange(len(lights)), regions.lengths)
    chosen = plates.of_light[owner] >= 0
    owner, points = owner[chosen], corners[regions.values[chosen]]
    points = np.concatenate([points, points.mean(axis=1, keepdims=True)], axis=1)
    plate = plates.of_light[owner]
    depth = -np.einsum("ikj,ij->ik", points - lights[owner, :1], normals[plate])
    inset = insets(lights)[owner]
    way = np.zeros(plates.count)
    np.maximum.at(way, plate, depth.max(axis=1, initial=0.0) + np.where(depth.max(axis=1, initial=0.0) > 0, inset, 0))
    behind = way[plate][:, None] - depth
    row, column = np.nonzero(behind > INSETS_UNSEEN * inset[:, None])
    reach = (behind[row, column] / THICKNESS_SHARE)[:, None] * normals[plate[row]]
    start = points[row, column]
    fraction = np.minimum(tree.first_hits(start - 0.01 * reach, start - reach, True) * 0.99 + 0.01, 1.0)
    allowed = depth[row, column] + fraction * behind[row, column]
    np.minimum.at(way, plate[row], allowed)
    least = np.full(plates.count, np.inf)
    np.minimum.at(least, plate, inset)
    # What is left of a way by rounding is none.
    return np.where(way > LEAST_WAY * least, way, 0.0)


def _mean_normals(lights: Float64, plates: Plates) -> Float64:
    """(plates, 3) unit."""
    rows = plates.of_light >= 0
    vectors = np.cross(lights[rows, 1] - lights[rows, 0], lights[rows, 2] - lights[rows, 0])
    sums = np.zeros((plates.count, 3))
    np.add.at(sums, plates.of_light[rows], vectors)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    mean: Float64 = sums / np.where(length > 0, length, 1.0)
    return mean


def _vertices_of(triangles: Int64, plates: Plates) -> tuple[Int64, Int64]:
    """(vertex, plate), each pair once, by vertex."""
    rows = np.flatnonzero(plates.of_light >= 0)
    pairs = np.stack([triangles[rows].ravel(), np.repeat(plates.of_light[rows], 3)], axis=1)
    unique = np.unique(pairs, axis=0)
    return unique[:, 0], unique[:, 1]


def _touching(pairs: tuple[Int64, Int64]) -> tuple[Int64, Int64]:
    """Pairs of plates that follow each other around a common vertex."""
    vertex, plate = pairs
    same = np.flatnonzero(vertex[1:] == vertex[:-1])
    return plate[same], plate[same + 1]


def _alike(pairs: tuple[Int64, Int64], normals: Float64) -> tuple[Int64, Int64]:
    """Those of them that meet at a small angle."""
    one, other = _touching(pairs)
    alike = np.einsum("ij,ij->i", normals[one], normals[other]) > LEAST_ANGLE_COSINE
    return one[alike], other[alike]


def _steps(pairs: tuple[Int64, Int64], normals: Float64, way: Float64, count: int) -> tuple[Float64, Float64]:
    """((v, 3) m shortest step of each vertex onto its planes moved back by `way`, (v,) m how far it stays off them)."""
    vertex, plate = pairs
    steps, off = np.zeros((count, 3)), np.zeros(count)
    starts = np.flatnonzero(np.diff(vertex, prepend=-1))
    for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(vertex)], strict=True):
        rows = plate[start:end]
        if not way[rows].any():
            continue
        step = np.linalg.lstsq(normals[rows], -way[rows], rcond=SAME_PLANE)[0]
        steps[vertex[start]] = step
        off[vertex[start]] = np.abs(normals[rows] @ step + way[rows]).max()
    return steps, off
