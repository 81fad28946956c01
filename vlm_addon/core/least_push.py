# SPDX-License-Identifier: GPL-3.0-or-later
"""The short way of shared vertices to where each light stands behind the deepest point of its region.

To move every vertex of a light back by the whole depth moves its neighbours with it, which then stand further behind
their surface than they need. Here each step moves the vertices next to the deepest point of each light alone, by their
weights at that point: projections onto convex sets in turn (Bauschke and Borwein 1996, On projection algorithms), with
a retreat towards the start in between, so that what one step moved in vain is given back.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .mesh_topology import Int64, Rows, sum_by
from .region_heights import RegionCorners
from .scene import Float64

STEPS = 12
# In so many first steps the moves are shortened to this share before they are corrected.
RETREATS, RETREAT = 6, 0.85
# Of a point far outside of its light, the vertex next to it moves by no more than five times the depth.
LEAST_GRIP = 0.2


def least_push(
    positions: Float64,
    triangles: Int64,
    regions: Rows,
    source_corners: Float64,
    spared: Float64,
    report: Callable[[float], None] = lambda share: None,
) -> Float64:
    """(v, 3) m: moves after which hardly any point of a region lies behind the plane of its light.

    positions: (v, 3). triangles: (n, 3). regions: rows of source_corners (t, 3, 3) of each light. spared: (n,) m, depth
    to which a light may stand in front. report: called with the share of the steps that are done, may raise.
    """
    moved = np.zeros_like(positions)
    report(0.0)
    places = RegionCorners.of(regions, source_corners)
    # Always back along the normals of the start: beside an open edge, a way that turns leaves the body sideways.
    back = -_normals(positions[triangles])[0]
    for step in range(STEPS):
        report(step / STEPS)
        if step < RETREATS:
            moved *= RETREAT
        change = _change(positions + moved, triangles, back, places, spared)
        if change is None:
            break
        moved += change
    return moved


def _change(
    positions: Float64, triangles: Int64, back: Float64, places: RegionCorners, spared: Float64
) -> Float64 | None:
    """(v, 3): the mean of what the lights that stand in front ask of each vertex, None where none does.

    back: (n, 3) unit, the way back of each light.
    """
    corners = positions[triangles]
    normals, doubled = _normals(corners)
    light, point, depth = _deepest_points(corners, normals, places)
    asking = (depth > spared[light]) & (doubled[light] > 0)
    light, point, depth = light[asking], point[asking], depth[asking]
    if not len(light):
        return None
    weights = _weights(corners[light], normals[light], doubled[light], point)
    shares = np.maximum(weights, 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    size = depth / np.maximum((weights * shares).sum(axis=1), LEAST_GRIP)
    vertex, share = triangles[light].ravel(), shares.ravel()
    # Of several lights, those whose deepest point is next to the vertex count most.
    asked = np.repeat(size[:, None] * back[light], 3, axis=0) * (share * share)[:, None]
    total = sum_by(vertex, share, len(positions))
    sums = np.stack([sum_by(vertex, asked[:, axis], len(positions)) for axis in range(3)], axis=1)
    change: Float64 = sums / np.where(total > 0, total, 1.0)[:, None]
    return change


def _deepest_points(corners: Float64, normals: Float64, places: RegionCorners) -> tuple[Int64, Float64, Float64]:
    """(lights that have a region, (n, 3) its deepest corner below the plane of the light, (n,) m how deep)."""
    light = np.flatnonzero(places.lengths > 0)
    if not len(light):
        return light, np.zeros((0, 3)), np.zeros(0)
    height = places.heights(corners[:, 0], normals)
    deepest = np.zeros(len(corners))
    deepest[light] = np.minimum.reduceat(height, places.starts[:-1][light])
    row = np.flatnonzero(height == np.repeat(deepest, places.lengths))
    row = row[np.searchsorted(row, places.starts[:-1][light])]
    return light, places.coordinates[:, row].T, -deepest[light]


def _weights(corners: Float64, normals: Float64, doubled: Float64, point: Float64) -> Float64:
    """(n, 3): barycentric coordinates of each point, seen along the normal, in the triangle beside it."""
    parts = []
    for corner in range(3):
        start, end = corners[:, (corner + 1) % 3], corners[:, (corner + 2) % 3]
        parts.append(np.einsum("ij,ij->i", np.cross(end - start, point - start), normals) / doubled)
    return np.stack(parts, axis=1)


def _normals(corners: Float64) -> tuple[Float64, Float64]:
    """(unit normals (n, 3), 0 where degenerate, twice the areas (n,))."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    return normals / np.where(doubled > 0, doubled, 1.0)[:, None], doubled
