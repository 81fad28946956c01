# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lights and clusters of a light tree light a point, each with a weight that is smooth in the point's place.

A cluster's window is 1 near its centroid and falls to 0 between one and two times a distance. Where it is 1 its lights
count, where it is 0 the cluster does: a light in it weighs win(cluster), the cluster weighs win(its parent) -
win(cluster), so that the weights along a light's line to the root always add up to 1. There is no cell, so no seam.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .form_factor import paired_form_factor
from .light_clusters import LightClusters, cluster_irradiance
from .light_mesh import VirtualLightMesh
from .light_tree import ROOT, LightTree
from .scene import UNTAGGED, Float64, Int32

Indices = npt.NDArray[np.intp]

_POINTS_PER_BLOCK = 256


@dataclass(frozen=True)
class LightCut:
    """Pairs of a point and a light or cluster that counts there, each with its weight.

    light_points, lights, light_weights: (m,). cluster_points, clusters, cluster_weights: (k,).
    """

    light_points: Indices
    lights: Indices
    light_weights: Float64
    cluster_points: Indices
    clusters: Indices
    cluster_weights: Float64


def light_cut(tree: LightTree, window: Float64, points: Float64) -> LightCut:
    """The pairs of `points` (p, 3). window: (c,), of LightClusters."""
    below, lights_of = _lists(tree.parent, len(tree)), _lists(tree.light_parent, len(tree))
    roots = np.flatnonzero(tree.parent == ROOT)
    point = np.repeat(np.arange(len(points)), len(roots))
    cluster = np.tile(roots, len(points))
    outer = np.ones(len(cluster))
    found: list[tuple[Indices, Indices, Float64]] = []
    members: list[tuple[Indices, Indices, Float64]] = []
    while len(cluster):
        distance = np.linalg.norm(points[point] - tree.centroid[cluster], axis=1)
        own = _window(distance, window[cluster])
        counts = outer > own
        found.append((point[counts], cluster[counts], (outer - own)[counts]))
        opened = own > 0.0
        point, cluster, own = point[opened], cluster[opened], own[opened]
        rows, lights = lights_of.of(cluster)
        members.append((point[rows], lights, own[rows]))
        rows, cluster = below.of(cluster)
        point, outer = point[rows], own[rows]
    return LightCut(*_joined(members), *_joined(found))


def cut_irradiance(
    tree: LightTree,
    clusters: LightClusters,
    light_mesh: VirtualLightMesh,
    radiosity: Float64,
    points: Float64,
    normals: Float64,
    point_tags: Int32,
) -> tuple[Float64, Int32]:
    """(p, 3) W/m² at points with unit normals, and (p,) how many lights and clusters were evaluated for each.

    radiosity: (n, 3) W/m². point_tags: (p,); lights of a point's own tag give nothing.
    """
    result = np.zeros((len(points), 3))
    counts = np.zeros(len(points), np.int32)
    corners = light_mesh.corners
    for block in _blocks(len(points)):
        cut = light_cut(tree, clusters.window, points[block])
        at, of = cut.light_points + block.start, cut.lights
        lit = radiosity[of].any(axis=1) & ~_own(point_tags[at], light_mesh.tag_ids[of])
        at, of, weight = at[lit], of[lit], cut.light_weights[lit]
        factors = paired_form_factor(points[at], normals[at], corners[of]) if len(at) else np.zeros(0)
        np.add.at(result, at, (weight * factors)[:, None] * radiosity[of])
        np.add.at(counts, at, 1)
        at, of = cut.cluster_points + block.start, cut.clusters
        lit = (clusters.power[of] > 0.0) & ~_own(point_tags[at], tree.tag_ids[of])
        at, of, weight = at[lit], of[lit], cut.cluster_weights[lit]
        irradiance = weight * cluster_irradiance(clusters, of, points[at], normals[at])
        np.add.at(result, at, irradiance[:, None] * clusters.colour[of])
        np.add.at(counts, at, 1)
    return result, counts


@dataclass(frozen=True)
class _Lists:
    """Members of each cluster. offsets: (c + 1,); members: sorted by cluster."""

    offsets: Indices
    members: Indices

    def of(self, clusters: Indices) -> tuple[Indices, Indices]:
        """Rows of `clusters` and the members of each, one after the other."""
        counts = self.offsets[clusters + 1] - self.offsets[clusters]
        rows = np.repeat(np.arange(len(clusters)), counts)
        within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
        return rows, self.members[self.offsets[clusters[rows]] + within]


def _lists(owner: Int32, count: int) -> _Lists:
    order = np.argsort(owner, kind="stable")
    order = order[owner[order] != ROOT]
    return _Lists(np.searchsorted(owner[order], np.arange(count + 1)), order)


def _window(distance: Float64, near: Float64) -> Float64:
    t = np.clip(distance / near - 1.0, 0.0, 1.0)
    return np.asarray(1.0 - t * t * (3.0 - 2.0 * t))


def _own(point_tags: Int32, light_tags: Int32) -> npt.NDArray[np.bool_]:
    return (light_tags != UNTAGGED) & (light_tags == point_tags)


def _joined(parts: list[tuple[Indices, Indices, Float64]]) -> tuple[Indices, Indices, Float64]:
    if not parts:
        return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
    first, second, third = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return first, second, third


def _blocks(count: int) -> Iterator[slice]:
    for start in range(0, count, _POINTS_PER_BLOCK):
        yield slice(start, min(start + _POINTS_PER_BLOCK, count))
