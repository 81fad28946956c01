# SPDX-License-Identifier: GPL-3.0-or-later
"""Clusters of virtual lights on nested grids: what of a light mesh counts one by one, and what counts together.

Cells of level l are 2^l times as large as the finest. A light enters at the level of its own size, so that a long wall
is not cut up and dust is not met one by one; a cluster holds the lights and clusters one level finer whose centroids
lie in its cell, which face the same of six ways and share a tag. Nothing here depends on radiosity: relighting leaves
the tree as it is. Relatives: light cuts (Walter et al. 2005), lighting grid hierarchies (Lin and Yuksel 2019).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .scene import Float64, Int32

Int64 = npt.NDArray[np.int64]

ROOT = -1
"""Parent of a cluster that has none."""
_SMALLEST_SHARE = 0.5
"""Quantile of the lights' radii that the finest cells fit: smaller lights are met together."""
_MAX_LEVELS = 40


@dataclass(frozen=True)
class LightTree:
    """Clusters in order of level, finest first.

    light_parent: (n,) int32, the cluster that each light is in. parent: (c,) int32, of each cluster, or ROOT. level:
    (c,) int32, from 1. centroid: (c, 3) float64, m, of the lights' area. radius: (c,) float64, m, farthest corner of a
    light from the centroid. tag_ids: (c,) int32.
    """

    light_parent: Int32
    parent: Int32
    level: Int32
    centroid: Float64
    radius: Float64
    tag_ids: Int32

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in vars(self).values())

    def levels(self) -> list[npt.NDArray[np.intp]]:
        """Clusters of each level, finest first."""
        return [np.flatnonzero(self.level == level) for level in np.unique(self.level)]

    def sums(self, of_lights: npt.NDArray[np.floating]) -> Float64:
        """(c, ...) float64 sum over the lights of each cluster; of_lights: (n, ...)."""
        total = np.zeros((len(self), *of_lights.shape[1:]))
        np.add.at(total, self.light_parent, of_lights)
        for clusters in self.levels():
            inner = clusters[self.parent[clusters] != ROOT]
            np.add.at(total, self.parent[inner], total[inner])
        return total


def build_light_tree(light_mesh: VirtualLightMesh) -> LightTree:
    """The tree of a valid light mesh; of one without lights, no clusters."""
    if len(light_mesh) == 0:
        empty = np.zeros(0, np.int32)
        return LightTree(empty, empty, empty, np.zeros((0, 3)), np.zeros(0), empty)
    corners = light_mesh.corners
    centroids = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centroids[:, None], axis=2).max(axis=1)
    cell = max(float(np.quantile(radii, _SMALLEST_SHARE)), float(np.finfo(float).tiny))
    low = centroids.min(axis=0)
    extent = float(np.ptp(centroids, axis=0).max())
    top = min(math.ceil(math.log2(max(extent / cell, 1.0))) + 1, _MAX_LEVELS)
    entry = np.clip(np.ceil(np.log2(np.maximum(radii, cell) / cell)), 0, top - 1).astype(np.intp)
    keys = np.column_stack([_facing(light_mesh.area_vectors), light_mesh.tag_ids])
    cells = np.floor((centroids - low) / cell).astype(np.int64)
    links = _group(cells, keys, entry, top)
    return _with_shapes(links, light_mesh, centroids)


@dataclass(frozen=True)
class _Links:
    light_parent: Int32
    parent: Int32
    level: Int32
    tag_ids: Int32


def _facing(area_vectors: Float64) -> Int64:
    """Which of six ways a light faces: its largest axis and that axis's sign."""
    axis = np.abs(area_vectors).argmax(axis=1)
    return 2 * axis + (np.take_along_axis(area_vectors, axis[:, None], axis=1)[:, 0] < 0.0)


def _group(cells: Int64, keys: Int64, entry: npt.NDArray[np.intp], top: int) -> _Links:
    """Clusters of all levels: at each, the lights that enter one level finer and the clusters of that level."""
    light_parent = np.full(len(cells), ROOT, np.int32)
    parents, levels, tags = [], [], []
    below = np.zeros((0, cells.shape[1] + keys.shape[1]), np.int64)
    count = 0
    for level in range(1, top + 1):
        own = np.flatnonzero(entry == level - 1)
        members = np.column_stack([cells[own] >> level, keys[own]])
        coarser = np.column_stack([below[:, :3] >> 1, below[:, 3:]])
        unique, inverse = np.unique(np.concatenate([coarser, members]), axis=0, return_inverse=True)
        inverse = inverse.reshape(-1).astype(np.int32) + count
        parents.append(inverse[: len(below)])
        light_parent[own] = inverse[len(below) :]
        levels.append(np.full(len(unique), level, np.int32))
        tags.append(unique[:, 4].astype(np.int32))
        below, count = unique, count + len(unique)
    parents.append(np.full(len(below), ROOT, np.int32))
    return _Links(light_parent, np.concatenate(parents), np.concatenate(levels), np.concatenate(tags))


def _with_shapes(links: _Links, light_mesh: VirtualLightMesh, centroids: Float64) -> LightTree:
    count = len(links.parent)
    blank = LightTree(
        links.light_parent, links.parent, links.level, np.zeros((count, 3)), np.zeros(count), links.tag_ids
    )
    # Lights without area still lie somewhere.
    weights = light_mesh.areas + np.finfo(float).tiny
    totals = blank.sums(np.column_stack([weights, weights[:, None] * centroids]))
    centroid = totals[:, 1:] / totals[:, :1]
    radius = np.zeros(count)
    corners, cluster = light_mesh.corners, links.light_parent.copy()
    lights = np.arange(len(cluster))
    while len(lights):
        reach = np.linalg.norm(corners[lights] - centroid[cluster, None], axis=2).max(axis=1)
        np.maximum.at(radius, cluster, reach)
        cluster = links.parent[cluster]
        lights, cluster = lights[cluster != ROOT], cluster[cluster != ROOT]
    return LightTree(links.light_parent, links.parent, links.level, centroid, radius, links.tag_ids)
