# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that each triangle of the visible surface most likely belongs to, where no map of regions is known.

The nearest light counts, in place and in direction: least squared distance from the middle of the triangle to the
light, plus the light's area times 1 - cosine between their normals, so that the two sides of a thin body stay apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .light_mesh import VirtualLightMesh
from .mesh_topology import Int64
from .morton import morton_codes
from .scene import Float64, Int32, Mesh
from .triangle_distance import flat_triangles

# Triangles that look for candidates together.
BLOCK = 64
# Candidate pairs held at once.
PAIRS_PER_BATCH = 1 << 20
# Blocks times lights whose bounds are held at once.
BOUNDS_PER_BATCH = 1 << 22


def pair_nearest(light_mesh: VirtualLightMesh, meshes: Sequence[Mesh]) -> tuple[Int32, ...]:
    """For each mesh, (its triangles,) int32: the row of the light nearest to each triangle, -1 where there is none."""
    corners = [mesh.positions[mesh.triangles] for mesh in meshes]
    counts = [len(each) for each in corners]
    if not sum(counts):
        return tuple(np.zeros(0, np.int32) for _ in meshes)
    lights = light_of_triangles(light_mesh.corners, np.concatenate(corners))
    return tuple(np.split(lights, np.cumsum(counts)[:-1]))


def light_of_triangles(light_corners: Float64, source_corners: Float64) -> Int32:
    """(t,) int32: the nearest of the lights (n, 3, 3) for each triangle (t, 3, 3), -1 without lights."""
    nearest = np.full(len(source_corners), -1, np.int32)
    if not len(light_corners) or not len(source_corners):
        return nearest
    middle, normal = source_corners.mean(axis=1), _unit_normals(source_corners)[0]
    axis = np.abs(normal).argmax(axis=1)
    side = 2 * axis + (normal[np.arange(len(normal)), axis] < 0)
    order = np.lexsort([morton_codes(middle), side])
    starts = np.arange(0, len(order), BLOCK)
    blocks_at_once = max(1, BOUNDS_PER_BATCH // len(light_corners))
    for first in range(0, len(starts), blocks_at_once):
        block = starts[first : first + blocks_at_once]
        rows = order[block[0] : block[-1] + BLOCK]
        nearest[rows] = _of_blocks(light_corners, middle[rows], normal[rows])
    return nearest


def _of_blocks(light_corners: Float64, middle: Float64, normal: Float64) -> Int32:
    """The nearest light of each triangle; BLOCK of them after each other lie together."""
    starts = np.arange(0, len(middle), BLOCK)
    low, high = np.minimum.reduceat(middle, starts), np.maximum.reduceat(middle, starts)
    block, light = _candidates(light_corners, low, high)
    flat = flat_triangles(light_corners)
    light_normal, area = _unit_normals(light_corners)
    nearest = np.empty(len(middle), np.int32)
    first_of = np.searchsorted(block, np.arange(len(starts) + 1))
    cost = np.cumsum(np.diff(first_of) * BLOCK)
    batch = np.searchsorted(cost, np.arange(1, cost[-1] // PAIRS_PER_BATCH + 2) * PAIRS_PER_BATCH) + 1
    begin = 0
    for end in np.unique(np.minimum(batch, len(starts))):
        rows = np.arange(starts[begin], min(starts[end - 1] + BLOCK, len(middle)))
        of_block = rows // BLOCK
        count = first_of[of_block + 1] - first_of[of_block]
        owner = np.repeat(np.arange(len(rows)), count)
        run = np.cumsum(count) - count
        which = light[first_of[of_block][owner] + np.arange(len(owner)) - run[owner]]
        score = flat.squared_distances(middle[rows][owner], which)
        cosine = np.einsum("ij,ij->i", normal[rows][owner], light_normal[which])
        score += (1.0 - cosine) * area[which]
        best = np.flatnonzero(score == np.minimum.reduceat(score, run)[owner])
        nearest[rows] = which[best[np.searchsorted(owner[best], np.arange(len(rows)))]]
        begin = int(end)
    return nearest


def _candidates(light_corners: Float64, low: Float64, high: Float64) -> tuple[Int64, Int64]:
    """(block, light) of all lights that may be the nearest of some point of each block's box, by block.

    No light whose box is farther away than the farthest way from the block to some light's middle can be the nearest.
    """
    light_low, light_high = light_corners.min(axis=1), light_corners.max(axis=1)
    light_middle = light_corners.mean(axis=1)
    area = _unit_normals(light_corners)[1]
    nearest, farthest = np.zeros((len(low), len(light_corners))), np.zeros((len(low), len(light_corners)))
    for axis in range(3):
        gap = np.maximum(light_low[None, :, axis] - high[:, None, axis], low[:, None, axis] - light_high[None, :, axis])
        nearest += np.maximum(gap, 0.0) ** 2
        way = np.maximum(
            high[:, None, axis] - light_middle[None, :, axis], light_middle[None, :, axis] - low[:, None, axis]
        )
        farthest += way**2
    most = (farthest + 2.0 * area).min(axis=1)
    block, light = np.nonzero(nearest <= most[:, None] * (1.0 + 1e-9))
    return block, light


def _unit_normals(corners: Float64) -> tuple[Float64, Float64]:
    """(unit normals, 0 where degenerate; areas in m²)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return normal / np.where(length > 0, length, 1.0)[:, None], 0.5 * length
