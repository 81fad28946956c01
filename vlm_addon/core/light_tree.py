# SPDX-License-Identifier: GPL-3.0-or-later
"""Clusters of virtual lights on nested grids: what of a light mesh counts one by one, and what counts together.

Cells of level l are 2^l times as large as the finest. A light enters at the level of its own size, so that a long wall
is not cut up and dust is not met one by one; a cluster holds the lights and finer clusters, two or more, whose
centroids lie in its cell, which face the same of six ways and share a tag. Nothing here depends on radiosity:
relighting leaves the tree as it is. Relatives: light cuts (Walter et al. 2005), lighting grid hierarchies (Lin and
Yuksel 2019).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .light_tree_bounds import (
    Shapes,
    empty_shapes,
    farthest_corners,
    join_upwards,
    light_shapes,
    place_moments,
    symmetric,
)
from .morton import spread_bits
from .scene import Float64, Int32

Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

ROOT = -1
"""Parent of a cluster that has none, and of a light that is not in the tree."""
_SMALLEST_SHARE = 0.5
"""Quantile of the lights' radii that is the edge of the finest cells: smaller lights are met together."""
_MAX_LEVELS = 21
"""Three coordinates of so many bits fit in one integer."""


@dataclass(frozen=True)
class LightTree:
    """Clusters in order of depth, deepest first, roots last; those of a depth in order of their parents.

    light_parent: (n,) int32, the cluster that each light is in, or ROOT. parent: (c,) int32, of each cluster, or ROOT.
    depth: (c,) int32, how many clusters a cluster is in. level: (c,) int32, from 1: its cell's edges are 2^level
    cell_size, m, and start at cell_origin. tag_ids: (c,) int32. light_order: (m,) int32, the lights in order of their
    clusters; light_offsets: (c + 1,) int32, those of cluster i are light_order[light_offsets[i]:light_offsets[i + 1]].
    child_offsets: (c + 1,) int32, the clusters in cluster i are child_offsets[i] to child_offsets[i + 1] - 1.
    shapes: where the lights of each cluster lie and which way they face. plane_axes: (c, 2, 3) orthonormal, the two
    directions in which its area spreads most.
    """

    light_parent: Int32
    parent: Int32
    depth: Int32
    level: Int32
    tag_ids: Int32
    light_order: Int32
    light_offsets: Int32
    child_offsets: Int32
    cell_origin: Float64
    cell_size: float
    shapes: Shapes
    plane_axes: Float64

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def centroid(self) -> Float64:
        """(c, 3) m, of the lights' area."""
        return self.shapes.centroid

    @property
    def radius(self) -> Float64:
        """(c,) m, farthest corner of a light from the centroid."""
        return self.shapes.radius

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        own = sum(array.nbytes for array in vars(self).values() if isinstance(array, np.ndarray))
        return own + sum(array.nbytes for array in vars(self.shapes).values())

    @property
    def roots(self) -> npt.NDArray[np.intp]:
        """Clusters without a parent."""
        return np.flatnonzero(self.parent == ROOT)

    def depths(self) -> list[slice]:
        """The clusters of each depth, deepest first."""
        edges = np.flatnonzero(np.diff(self.depth, prepend=-1, append=-1))
        return [slice(int(start), int(end)) for start, end in itertools.pairwise(edges)]

    def sums(self, of_members: Float64) -> Float64:
        """(k, c) sums over the lights of each cluster; of_members: (k, m), of lights in the order of light_order."""
        owner = np.repeat(np.arange(len(self)), np.diff(self.light_offsets))
        total = np.zeros((len(of_members), len(self)))
        for row, values in zip(total, of_members, strict=True):
            row += np.bincount(owner, values, len(self))
        for part in self.depths():
            owner = self.parent[part].astype(np.intp)
            if len(owner) and owner[0] != ROOT:
                low, high = owner[0], owner[-1] + 1
                for row in total:
                    row[low:high] += np.bincount(owner - low, row[part], high - low)
        return total


def build_light_tree(light_mesh: VirtualLightMesh, chosen: Bools | None = None) -> LightTree:
    """The tree of a valid light mesh, or of its lights `chosen` (n,) alone; of no lights, no clusters."""
    rows = np.arange(len(light_mesh)) if chosen is None else np.flatnonzero(chosen)
    light_parent = np.full(len(light_mesh), ROOT, np.int32)
    if len(rows) == 0:
        none, offsets = np.zeros(0, np.int32), np.zeros(1, np.int32)
        axes = np.zeros((0, 2, 3))
        return LightTree(
            light_parent, none, none, none, none, none, offsets, offsets, np.zeros(3), 1.0, empty_shapes(), axes
        )
    lights = light_shapes(light_mesh.corners[rows])
    grid = _grid(lights.centroid, lights.radius)
    facing, tags = _facing(lights.axis), light_mesh.tag_ids[rows]
    order = np.lexsort((grid.codes, facing, tags))
    links = _group(grid.codes[order], np.stack([facing, tags])[:, order], grid.entry[order], grid.levels)
    links = _by_depth(links)
    light_parent[rows[order]] = links.light_parent
    by_cluster = np.argsort(links.light_parent, kind="stable")
    every = np.arange(len(links.parent) + 1)
    tree = LightTree(
        light_parent=light_parent,
        parent=links.parent,
        depth=links.depth,
        level=links.level,
        tag_ids=tags[order][links.first_light].astype(np.int32),
        light_order=rows[order[by_cluster]].astype(np.int32),
        light_offsets=np.searchsorted(links.light_parent[by_cluster], every).astype(np.int32),
        child_offsets=np.searchsorted(links.parent[links.parent != ROOT], every).astype(np.int32),
        cell_origin=grid.origin,
        cell_size=grid.cell,
        shapes=empty_shapes(),
        plane_axes=np.zeros((0, 2, 3)),
    )
    members = lights.take(order[by_cluster])
    shapes = join_upwards(members, tree.light_offsets, tree.child_offsets, tree.depths())
    radius = farthest_corners(light_mesh.corners, light_parent, links.parent, shapes.centroid)
    tree = replace(tree, shapes=replace(shapes, radius=radius))
    return replace(tree, plane_axes=_plane_axes(tree, light_mesh.corners))


def _plane_axes(tree: LightTree, corners: Float64) -> Float64:
    """As in LightTree."""
    areas, moments = place_moments(corners[tree.light_order] - tree.centroid.mean(axis=0))
    sums = tree.sums(areas * np.concatenate([np.ones((1, len(areas))), moments]))
    covariance = symmetric(sums[4:] / np.maximum(sums[0], np.finfo(float).tiny))
    mean = sums[1:4].T / np.maximum(sums[0], np.finfo(float).tiny)[:, None]
    vectors = np.linalg.eigh(covariance - np.einsum("ci,cj->cij", mean, mean))[1]
    return np.ascontiguousarray(vectors[:, :, :0:-1].transpose(0, 2, 1))


@dataclass(frozen=True)
class _Grid:
    """Finest cells of lights as Morton codes, the levels at which they enter, and how many levels there are."""

    origin: Float64
    cell: float
    codes: Int64
    entry: Int64
    levels: int


def _grid(centroids: Float64, radii: Float64) -> _Grid:
    low = centroids.min(axis=0)
    extent = float(np.ptp(centroids, axis=0).max())
    least = max(extent * 2.0 ** (1 - _MAX_LEVELS), float(np.finfo(float).tiny))
    cell = max(float(np.quantile(radii, _SMALLEST_SHARE)), least)
    levels = min(math.ceil(math.log2(max(extent / cell, 1.0))) + 1, _MAX_LEVELS)
    # Cells of the level above the lights' own are as large as the lights' radii.
    entry = np.clip(np.ceil(np.log2(np.maximum(radii, 2.0 * cell) / cell)) - 1, 0, levels - 1).astype(np.int64)
    cells = np.minimum(np.floor((centroids - low) / cell), 2**_MAX_LEVELS - 1).astype(np.int64)
    return _Grid(low, cell, spread_bits(cells) @ np.array([1, 2, 4]), entry, levels)


def _facing(normals: Float64) -> Int64:
    """Which of six ways a light faces: its largest axis and that axis's sign."""
    axis = np.abs(normals).argmax(axis=1)
    return 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] < 0.0)


@dataclass(frozen=True)
class _Links:
    """first_light: (c,) any one light of each cluster. Others as in LightTree."""

    light_parent: Int32
    parent: Int32
    depth: Int32
    level: Int32
    first_light: npt.NDArray[np.intp]


def _group(codes: Int64, keys: Int64, entry: Int64, levels: int) -> _Links:
    """Clusters of all levels, coarser ones later, of lights in order of keys and codes.

    A cell becomes a cluster where it holds at least two lights or clusters; at last whatever is left.
    """
    count = len(codes)
    group = np.append(0, (np.diff(keys, axis=1) != 0).any(axis=0)).cumsum()
    # What each light is part of so far: itself (its row), or a cluster (count + its number).
    item = np.arange(count)
    owner = np.full(2 * count, ROOT, np.int32)
    firsts, found_levels = [], []
    total = 0
    for level in range(1, levels + 1):
        inside = np.flatnonzero(entry < level)
        new_cell = _changes(codes[inside] >> 3 * level) | _changes(group[inside])
        new_item = new_cell | _changes(item[inside])
        cell = new_cell.cumsum() - 1
        members = np.bincount(cell[new_item], minlength=1)
        kept = members > 1
        if level == levels:
            kept |= item[inside[new_cell]] < count
        number = total + kept.cumsum() - 1
        grouped = kept[cell]
        owner[item[inside[grouped]]] = number[cell[grouped]]
        firsts.append(inside[new_cell][kept])
        item[inside[grouped]] = count + number[cell[grouped]]
        found_levels.append(np.full(len(firsts[-1]), level, np.int32))
        total += len(firsts[-1])
    parent = owner[count : count + total]
    level_of = np.concatenate(found_levels)
    depth = np.zeros(total, np.int32)
    for coarse in range(1, levels)[::-1]:
        inner = np.flatnonzero((level_of == coarse) & (parent != ROOT))
        depth[inner] = depth[parent[inner]] + 1
    return _Links(owner[:count], parent, depth, level_of, np.concatenate(firsts))


def _changes(values: npt.NDArray[np.integer]) -> Bools:
    """Where a run of equal values begins."""
    return np.append(True, np.diff(values) != 0)[: len(values)]


def _by_depth(links: _Links) -> _Links:
    """The same in the order of LightTree."""
    place = np.full(len(links.parent) + 1, 0, np.int32)
    order = np.zeros(0, np.intp)
    for depth in range(int(links.depth.max()) + 1):
        own = np.flatnonzero(links.depth == depth)
        own = own[np.argsort(place[links.parent[own]], kind="stable")]
        place[own] = np.arange(len(own))
        order = np.concatenate([own, order])
    place[order] = np.arange(len(order))
    place[ROOT] = ROOT
    return _Links(
        place[links.light_parent],
        place[links.parent[order]],
        links.depth[order],
        links.level[order],
        links.first_light[order],
    )
