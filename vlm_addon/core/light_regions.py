# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the visible surface that each light stands in front of or behind, for lights that are to be moved.

The triangle nearest to a light is not enough: of a floor of two triangles, one light of many may get both and the
others none, and corners of it that lie far outside of the light must not push it.
"""

from __future__ import annotations

import numpy as np

from .light_mesh import VirtualLightMesh
from .mesh_topology import Int64, Rows, rows_by_key, unit_normals
from .scene import Float64
from .triangle_tree import TriangleTree

# How far, in sizes (square root of the area) of its light, a sample may lie off its triangle.
SAMPLE_REACH = 1e-3
# A triangle is large where its longest side exceeds so many sizes of the light.
LARGE = 1.0
# What is left of a clipped triangle counts from this share of the area of its light.
LEAST_SHARE = 1e-6


def pushing_regions(
    light_mesh: VirtualLightMesh, nearest: Rows, corners: Float64, tree: TriangleTree
) -> tuple[Float64, Rows]:
    """(corners (k, 3, 3) m, regions) of what a light is to stand behind: rows of the former for each light.

    That is the triangles that its samples lie on and those of `nearest`, rows of `corners` (t, 3, 3) for each light;
    of large ones only what lies in front of or behind the light. tree: of `corners`.
    """
    light, triangle = _pairs(light_mesh, nearest, tree)
    sizes = np.sqrt(light_mesh.areas)
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1, initial=0.0)
    large = sides[triangle] > LARGE * sizes[light]
    pieces, owners = [corners], [light[~large]]
    for one, other in zip(light[large].tolist(), triangle[large].tolist(), strict=True):
        piece = _clipped(corners[other], light_mesh.corners[one])
        pieces.append(piece)
        owners.append(np.full(len(piece), one))
    rows = np.concatenate([triangle[~large], len(corners) + np.arange(sum(map(len, pieces[1:])))])
    return np.concatenate(pieces), rows_by_key(np.concatenate(owners), len(light_mesh), rows)


def _pairs(light_mesh: VirtualLightMesh, nearest: Rows, tree: TriangleTree) -> tuple[Int64, Int64]:
    """(light, triangle), each pair once."""
    samples = light_mesh.samples
    owner = np.repeat(np.arange(len(light_mesh)), np.diff(samples.offsets))
    reach = (SAMPLE_REACH * np.sqrt(light_mesh.areas[owner]))[:, None] * samples.normals
    met = tree.first_met(samples.positions + reach, samples.positions - reach)
    light = np.concatenate([owner[met >= 0], np.repeat(np.arange(len(light_mesh)), nearest.lengths)])
    triangle = np.concatenate([met[met >= 0], nearest.values])
    pairs = np.unique(np.stack([light, triangle], axis=1), axis=0)
    return pairs[:, 0], pairs[:, 1]


def _clipped(triangle: Float64, light: Float64) -> Float64:
    """(k, 3, 3): what of a triangle (3, 3) the light (3, 3) covers along its normal, as triangles; none for none."""
    vector = np.cross(light[1] - light[0], light[2] - light[0])
    ring = triangle
    for corner in range(3):
        start, end = light[corner], light[(corner + 1) % 3]
        ring = _cut(ring, (ring - start) @ np.cross(vector, end - start))
        if len(ring) < 3:
            return np.zeros((0, 3, 3))
    fan = np.stack([np.broadcast_to(ring[0], (len(ring) - 2, 3)), ring[1:-1], ring[2:]], axis=1)
    doubled = np.linalg.norm(np.cross(fan[:, 1] - fan[:, 0], fan[:, 2] - fan[:, 0]), axis=1)
    return fan[doubled > LEAST_SHARE * np.linalg.norm(vector)]


def _cut(ring: Float64, height: Float64) -> Float64:
    """The part of a convex polygon (k, 3) with heights of at least 0."""
    kept = []
    for row in range(len(ring)):
        after = (row + 1) % len(ring)
        if height[row] >= 0.0:
            kept.append(ring[row])
        if (height[row] >= 0.0) != (height[after] >= 0.0):
            share = height[row] / (height[row] - height[after])
            kept.append(ring[row] + share * (ring[after] - ring[row]))
    return np.array(kept).reshape(-1, 3)


def facing(corners: Float64, regions: Rows, lights: Float64, least_cosine: float) -> Rows:
    """The regions without what faces further away from its light than `least_cosine` says."""
    owner = np.repeat(np.arange(len(lights)), regions.lengths)
    cosine = np.einsum("ij,ij->i", unit_normals(corners[regions.values]), unit_normals(lights)[owner])
    kept = cosine > least_cosine
    return rows_by_key(owner[kept], len(lights), regions.values[kept])
