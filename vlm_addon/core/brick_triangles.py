# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles behind the voxels of an octree: which meet each voxel, and where ways between points meet them.

What follows is in voxel coordinates from 0 to 2^depth, in float32 on the device: corners are multiples of
`lattice_step`, which is also the most by which one rounding of such a coordinate is off. Everything here that is small
is a number of those steps, so none depends on the scene. `gpu_shaders/lib/octree_triangles.glsl` is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .octree_march import Floats, boxes_at, cells_at, finite_segments, lifted, lifted_by, next_cells, segments_clear
from .scene import Float64
from .voxel_octree import Bools, Int64, VoxelOctree, codes_of, meeting_voxels, require_places, tree_of_codes

LATTICE_SHARE = 2.0**-24
"""Of the side of all voxels: `lattice_step`."""
EDGE_SHARE = 8.0 * LATTICE_SHARE
"""Of the side of all voxels: how far outside its edges a way still meets a triangle. Two triangles see their shared
edge from the same two corners; across the way, each of those is off by some 2 steps for the differences and 2 for the
shear, the same in both, and the side of the edge on which the way lies by less than 4 in each."""
LIFT_SHARE = 64.0 * LATTICE_SHARE
"""Of the side of all voxels: how far over their own planes ways begin and end. Corners are off by a step, a position in
a G-buffer or of a light by some 4, its voxel coordinates by 3, its height over a plane by 4, and EDGE_SHARE is 8."""

ALL_EXACT = 1 << 20
"""Voxels from both ends of a way within which triangles are asked, where all are."""


def lattice_step(depth: int) -> float:
    """Coordinates from 0 to 2^depth are multiples of this on the device: differences of two are exact in float32."""
    return LATTICE_SHARE * float(1 << depth)


@dataclass(frozen=True)
class ExactOctree:
    """tree: of all voxels that meet a triangle. codes: (v,) those voxels, ascending along the Z-order curve. starts:
    (v + 1,) where the list of each begins in `triangles`, ascending. places: (t, 3, 3) corners in voxel coordinates."""

    tree: VoxelOctree
    codes: Int64
    starts: Int64
    triangles: Int64
    places: Float64


def build_exact_octree(places: Float64, depth: int, growth: float = 0.0) -> ExactOctree:
    """The octree of (t, 3, 3) `places` in voxel coordinates and the triangles of its voxels.

    growth: every voxel is larger by so much on each side. Raises InvalidInput for corners that are not finite or
    outside the cube.
    """
    require_places(places, depth)
    parts = [np.zeros((2, 0), np.int64), *(np.stack(part) for part in meeting_voxels(places, depth, growth))]
    triangles, voxels = np.concatenate(parts, axis=1)
    order = np.lexsort((triangles, voxels))
    codes, starts = np.unique(voxels[order], return_index=True)
    return ExactOctree(tree_of_codes(codes, depth), codes, np.append(starts, len(order)), triangles[order], places)


def crossings(starts: Float64, ends: Float64, corners: Float64, slack: float = 0.0) -> Float64:
    """(n,) fraction of each way, (n, 3) start to end, at which it meets triangle i of (n, 3, 3) corners, else inf.

    slack: how far outside the triangle's edges, across the way's longest axis, it still does. Corners are seen along
    the way from a point on it (Woop, Benthin and Wald 2013).
    """
    along = ends - starts
    local = corners - starts[:, None]
    normals = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
    before = -np.einsum("ij,ij->i", normals, local[:, 0])
    after = np.einsum("ij,ij->i", normals, along - local[:, 0])
    axis = np.argmax(np.abs(along), axis=1)
    order = (axis[:, None] + (1, 2, 3)) % 3
    along = np.take_along_axis(along, order, axis=1)
    local = np.take_along_axis(local, order[:, None], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = along[:, :2] / along[:, 2:]
        fractions = before / (before - after)
    seen = local[:, :, :2] - slope[:, None] * local[:, :, 2:]
    edges = np.roll(seen, -1, axis=1) - seen
    sides = edges[:, :, 1] * seen[:, :, 0] - edges[:, :, 0] * seen[:, :, 1]
    most = slack * np.abs(edges).sum(axis=2)
    within = (sides >= -most).all(axis=1) | (sides <= most).all(axis=1)
    return np.where(within & ((before > 0.0) != (after > 0.0)), fractions, np.inf)


def first_crossings(octree: ExactOctree, starts: Float64, ends: Float64) -> tuple[Float64, Int64]:
    """(n,) fractions of ways at which they first meet a triangle, inf where none, and (n,) the triangle, of two as near
    the one of the smaller number; -1 where none, and where ends are not finite."""
    slack = EDGE_SHARE * float(1 << octree.tree.depth)
    fractions, first = np.full(len(starts), np.inf), np.full(len(starts), -1, np.int64)
    rows = finite_segments(starts, ends)
    cells = cells_at(starts[rows])
    while len(rows):
        boxes = boxes_at(octree.tree, cells)
        voxels = np.searchsorted(octree.codes, codes_of(cells[boxes.occupied]))
        counts = np.diff(octree.starts)[voxels]
        asking = np.repeat(rows[boxes.occupied], counts)
        within = np.arange(len(asking)) - np.repeat(np.cumsum(counts) - counts, counts)
        triangles = octree.triangles[np.repeat(octree.starts[voxels], counts) + within]
        found = crossings(starts[asking], ends[asking], octree.places[triangles], slack)
        for row, fraction, triangle in zip(asking.tolist(), found.tolist(), triangles.tolist(), strict=True):
            if fraction <= 1.0 and (fraction, triangle) < (fractions[row], first[row]):
                fractions[row], first[row] = fraction, triangle
        rows, cells = next_cells(rows, cells, boxes.low, boxes.high, starts, ends)
    return fractions, first


def segments_open(octrees: Sequence[ExactOctree], starts: Float64, ends: Float64) -> Bools:
    """(n,) whether no triangle is on the ways."""
    return np.asarray(np.all([np.isinf(first_crossings(octree, starts, ends)[0]) for octree in octrees], axis=0))


def points_see(
    octrees: Sequence[ExactOctree],
    places: Floats,
    normals: Floats,
    others: Floats,
    other_normals: Floats,
    exact_reach: int,
) -> Bools:
    """(n,) whether surface points see others, in voxel coordinates; normals unit, geometric, on the side of the way.

    exact_reach, from 1: so many voxels of the way at either end, along its longest axis, are asked for triangles; in
    between it goes where octree_march.surfaces_see goes and every occupied voxel blocks. Four short ways join the two.
    """
    points, turned = (places, normals, others, other_normals), (others, other_normals, places, normals)
    lift = np.full(len(places), LIFT_SHARE * float(1 << octrees[0].tree.depth))
    starts, ends = lifted_by(lift, lift, *points), lifted_by(lift, lift, *turned)
    high_starts, high_ends = lifted(*points), lifted(*turned)
    too_near, voxels_too_near = (
        np.einsum("ij,ij->i", b - a, others - places) <= 0.0 for a, b in ((starts, ends), (high_starts, high_ends))
    )
    share = exact_reach / np.maximum(np.abs(ends - starts).max(axis=1), LIFT_SHARE)
    all_exact = (share >= 0.5) | voxels_too_near
    sees = np.ones(len(places), bool)
    sees[all_exact] = segments_open(octrees, starts[all_exact], ends[all_exact])
    mixed = np.flatnonzero(~all_exact)
    part = share[mixed, None]
    low, high = (starts[mixed], ends[mixed]), (high_starts[mixed], high_ends[mixed])
    leaving, arriving = (a + (b - a) * part for a, b in (low, low[::-1]))
    high_leaving, high_arriving = (a + (b - a) * part for a, b in (high, high[::-1]))
    short_ways = ((low[0], leaving), (arriving, low[1]), (leaving, high_leaving), (high_arriving, arriving))
    joined = np.all([segments_open(octrees, *way) for way in short_ways], axis=0)
    between = np.all([segments_clear(octree.tree, high_leaving, high_arriving) for octree in octrees], axis=0)
    sees[mixed] = joined & between
    return sees | too_near
