# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lights and clusters of a light tree light a point, each with a weight that is smooth in the point's place.

A cluster's window is 1 near its centroid and falls to 0 within a fifth of its reach. Where it is 1 its lights count,
where it is 0 the cluster does: a light in it weighs win(cluster), the cluster weighs win(its parent) - win(cluster), so
that the weights along a light's line to the root always add up to 1. There is no cell, so no seam.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .form_factor import paired_form_factor
from .light_clusters import FADE, LightClusters, cluster_irradiance
from .light_links import leaves_out
from .light_mesh import VirtualLightMesh
from .light_tree import LightTree
from .light_tree_bounds import facing_height, horizon_height
from .scene import Float64, Int32

Indices = npt.NDArray[np.intp]
Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Test = Callable[[Indices, Indices], Bools]

_POINTS_PER_BLOCK = 256
# Shares of the distance below which the side of a plane is left to the form factor to decide.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class LightCut:
    """Pairs of a point and a light or cluster that counts there, each with its weight.

    light_points, lights, light_weights: (m,). cluster_points, clusters, cluster_weights: (k,). visited: (p,) lights
    and clusters that were met at each point.
    """

    light_points: Indices
    lights: Indices
    light_weights: Float64
    cluster_points: Indices
    clusters: Indices
    cluster_weights: Float64
    visited: Int64


@dataclass(frozen=True)
class CutIrradiance:
    """irradiance: (p, 3) W/m². evaluated: (p,) form factors and cluster formulas computed. visited: (p,) lights and
    clusters that were met, among them those of which a test showed that they give exactly nothing."""

    irradiance: Float64
    evaluated: Int64
    visited: Int64


def light_cut(tree: LightTree, window: Float64, points: Float64, gives_nothing: Test | None = None) -> LightCut:
    """The pairs of `points` (p, 3). window: (c,), of LightClusters.

    gives_nothing: of rows of points and of clusters, (m,) each, those where nothing in the cluster counts.
    """
    roots = tree.roots
    point, cluster = np.repeat(np.arange(len(points)), len(roots)), np.tile(roots, len(points))
    outer = np.ones(len(cluster))
    visited = np.zeros(len(points), np.int64)
    found: list[tuple[Indices, Indices, Float64]] = []
    members: list[tuple[Indices, Indices, Float64]] = []
    while len(cluster):
        visited += np.bincount(point, minlength=len(points))
        if gives_nothing is not None:
            kept = ~gives_nothing(point, cluster)
            point, cluster, outer = point[kept], cluster[kept], outer[kept]
        distance = np.linalg.norm(points[point] - tree.centroid[cluster], axis=1)
        own = _window(distance, window[cluster])
        counts = outer > own
        found.append((point[counts], cluster[counts], (outer - own)[counts]))
        opened = own > 0.0
        point, cluster, own = point[opened], cluster[opened], own[opened]
        rows, lights = _members(tree.light_offsets, cluster)
        members.append((point[rows], tree.light_order[lights], own[rows]))
        rows, cluster = _members(tree.child_offsets, cluster)
        point, outer = point[rows], own[rows]
    of_lights, of_clusters = _joined(members), _joined(found)
    visited += np.bincount(of_lights[0], minlength=len(points))
    return LightCut(*of_lights, *of_clusters, visited)


def cut_irradiance(
    tree: LightTree,
    clusters: LightClusters,
    light_mesh: VirtualLightMesh,
    radiosity: Float64,
    points: Float64,
    normals: Float64,
    point_tags: Int32,
) -> CutIrradiance:
    """At points with unit normals. radiosity: (n, 3) W/m². point_tags: (p,); lights that leave a
    point's tag out give nothing.

    Subtrees without power, that leave the point out, face away or lie under the horizon are not walked; they give
    exactly nothing, so that the result is the same as if they were.
    """
    result, evaluated = np.zeros((len(points), 3)), np.zeros(len(points), np.int64)
    visited = np.zeros(len(points), np.int64)
    corners, area_vectors = light_mesh.corners, light_mesh.area_vectors
    for block in _blocks(len(points)):
        at_points, at_normals, at_tags = points[block], normals[block], point_tags[block]

        def nothing(
            point: Indices, cluster: Indices, p: Float64 = at_points, n: Float64 = at_normals, t: Int32 = at_tags
        ) -> Bools:
            left_out = leaves_out(light_mesh.links, tree.tag_ids[cluster], t[point])
            return left_out | _gives_nothing(tree, clusters, cluster, p[point], n[point])

        cut = light_cut(tree, clusters.window, at_points, nothing)
        at, of = cut.light_points, cut.lights
        lit = radiosity[of].any(axis=1) & _may_light(at_points[at], at_normals[at], corners[of], area_vectors[of])
        at, of, weight = at[lit], of[lit], cut.light_weights[lit]
        factors = paired_form_factor(at_points[at], at_normals[at], corners[of]) if len(at) else np.zeros(0)
        np.add.at(result[block], at, (weight * factors)[:, None] * radiosity[of])
        evaluated[block] += np.bincount(at, minlength=len(at_points))
        at, of = cut.cluster_points, cut.clusters
        irradiance = cluster_irradiance(tree, clusters, of, at_points[at], at_normals[at])
        np.add.at(result[block], at, (cut.cluster_weights * irradiance)[:, None] * clusters.colour[of])
        evaluated[block] += np.bincount(at, minlength=len(at_points))
        visited[block] = cut.visited
    return CutIrradiance(result, evaluated, visited)


def _gives_nothing(
    tree: LightTree, clusters: LightClusters, cluster: Indices, points: Float64, normals: Float64
) -> Bools:
    """(m,) whether no light of a cluster lights a point, by its power, the way it faces or where it lies."""
    shapes = tree.shapes.take(cluster)
    nothing = clusters.power[cluster] <= 0.0
    nothing |= facing_height(shapes, points) <= 0.0
    return np.asarray(nothing | (horizon_height(shapes, points, normals) <= 0.0))


def _may_light(points: Float64, normals: Float64, corners: Float64, area_vectors: Float64) -> Bools:
    """(m,) False where a light clearly faces away from a point or lies under its horizon."""
    arms = corners - points[:, None]
    slack = _ROUNDING * np.abs(arms).max(axis=(1, 2))
    rises = np.einsum("nki,ni->nk", arms, normals).max(axis=1) > -slack
    depth = np.einsum("ni,ni->n", arms[:, 0], area_vectors)
    return np.asarray(rises & (depth < slack * np.linalg.norm(area_vectors, axis=1)))


def _members(offsets: Int32, clusters: Indices) -> tuple[Indices, Indices]:
    """Rows of `clusters` and the members of each, one after the other."""
    counts = offsets[clusters + 1] - offsets[clusters]
    rows = np.repeat(np.arange(len(clusters)), counts)
    within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    return rows, offsets[clusters[rows]] + within


def _window(distance: Float64, near: Float64) -> Float64:
    t = np.clip((distance / near - 1.0) / FADE, 0.0, 1.0)
    return np.asarray(1.0 - t * t * (3.0 - 2.0 * t))


def _joined(parts: list[tuple[Indices, Indices, Float64]]) -> tuple[Indices, Indices, Float64]:
    if not parts:
        return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
    first, second, third = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return first, second, third


def _blocks(count: int) -> Iterator[slice]:
    for start in range(0, count, _POINTS_PER_BLOCK):
        yield slice(start, min(start + _POINTS_PER_BLOCK, count))
