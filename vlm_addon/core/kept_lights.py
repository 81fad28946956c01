# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that stay when a light mesh is made again, and the surface that they stand for."""

from __future__ import annotations

import numpy as np

from .light_mesh import VirtualLightMesh
from .mesh_topology import Int64
from .sampling import square_to_triangle
from .scene import Float64
from .triangle_tree import build_tree

# How far behind its surface, and in front of it, a light is looked for, in sizes (square root of the area) of the
# largest and then of itself.
REACH_SIZES = 1.0
LEAD_SIZES = 0.1
# Between a light and its surface.
SIMILAR_COSINE = 0.5
# Points of a source triangle, of which more than half must have the light behind them.
POINTS = square_to_triangle(np.array([0.5, 0.1, 0.9, 0.45, 0.55]), np.array([0.5, 0.2, 0.8, 0.9, 0.1]))


def kept_regions(keep: VirtualLightMesh, corners: Float64, normals: Float64) -> Int64:
    """(t,) the light of `keep` that stands behind each source triangle and faces as it does, -1 for none.

    corners: (t, 3, 3), m. normals: (t, 3) unit, 0 for a triangle without area. A triangle belongs to a light that more
    than half of it lies before; large triangles of which lights cover less keep all of their surface.
    """
    if not len(keep):
        return np.full(len(corners), -1, np.int64)
    sizes = np.sqrt(keep.areas)
    light_normals = keep.area_vectors / np.maximum(keep.areas, np.finfo(float).tiny)[:, None]
    # Turned over, so that the tree's test for backs finds fronts.
    tree = build_tree(keep.corners[:, ::-1])
    low, high = keep.corners.min(axis=(0, 1)), keep.corners.max(axis=(0, 1))
    near = _near_box(corners, low, high, REACH_SIZES * float(sizes.max()))
    found = np.full((len(near), len(POINTS)), -1, np.int64)
    for column, weights in enumerate(POINTS):
        points = np.einsum("k,tkj->tj", weights, corners[near])
        start = points + LEAD_SIZES * float(sizes.max()) * normals[near]
        end = points - REACH_SIZES * float(sizes.max()) * normals[near]
        met = tree.first_met(start, end, True)
        light = np.maximum(met, 0)
        alike = np.einsum("tj,tj->t", normals[near], light_normals[light]) >= SIMILAR_COSINE
        depth = np.einsum("tj,tj->t", points - keep.corners[light, 0], light_normals[light])
        alike &= (depth <= REACH_SIZES * sizes[light]) & (depth >= -LEAD_SIZES * sizes[light])
        found[:, column] = np.where((met >= 0) & alike, met, -1)
    result = np.full(len(corners), -1, np.int64)
    result[near] = _majority(found)
    return result


def _near_box(corners: Float64, low: Float64, high: Float64, reach: float) -> Int64:
    """Triangles that come within `reach` of a box."""
    inside = (corners.max(axis=1) >= low - reach) & (corners.min(axis=1) <= high + reach)
    return np.flatnonzero(inside.all(axis=1))


def _majority(found: Int64) -> Int64:
    """(t,) the light most often among the columns of each row where more than half of them have any, else -1."""
    ordered = np.sort(found, axis=1)
    times = (ordered[:, :, None] == ordered[:, None, :]).sum(axis=2)
    times[ordered < 0] = 0
    best = np.take_along_axis(ordered, times.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.where(2 * (found >= 0).sum(axis=1) > found.shape[1], best, -1)
