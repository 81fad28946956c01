# SPDX-License-Identifier: GPL-3.0-or-later
"""How far light trees are from the full sum: measured at points of surfaces, and estimated anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .form_factor import paired_form_factor
from .light_clusters import LightClusters, cluster_error
from .light_cut import cut_irradiance, light_cut
from .light_links import leaves_out
from .light_mesh import VirtualLightMesh
from .light_tree import LightTree
from .light_tree_bounds import facing_height
from .metrics import point_error, within_tolerance
from .scene import Float64, Int32

Structure = tuple[LightTree, LightClusters]

_PAIRS_PER_BLOCK = 1 << 20
_POINTS_PER_BLOCK = 256
_ROUNDING = 1e-9
_FAR_RADII = 4.0


@dataclass(frozen=True)
class PointErrors:
    """errors: (p,) `point_error` of the sum of the channels.

    evaluated, visited: means over the points, as in CutIrradiance.
    """

    errors: Float64
    evaluated: float
    visited: float

    def quantile(self, share: float) -> float:
        """The error that this share of the points does not exceed; 0 without points."""
        return float(np.quantile(self.errors, share)) if len(self.errors) else 0.0

    def within(self, tolerance: float) -> bool:
        """As `metrics.within_tolerance`."""
        return within_tolerance(self.errors, tolerance)


def tree_errors(
    structures: Sequence[Structure],
    light_mesh: VirtualLightMesh,
    radiosity: Float64,
    points: Float64,
    normals: Float64,
    point_tags: Int32,
) -> PointErrors:
    """Errors of trees that together hold all lights, at (p, 3) points of surfaces with unit normals.

    radiosity: (n, 3) W/m². Compares with every light at every point: a few hundred points are a matter of
    seconds with 100,000 lights, and their 99.9th percentile is their greatest error.
    """
    full = full_irradiance(light_mesh, radiosity, points, normals, point_tags).sum(axis=1)
    found, evaluated, visited = np.zeros(len(points)), 0.0, 0.0
    for tree, clusters in structures:
        cut = cut_irradiance(tree, clusters, light_mesh, radiosity, points, normals, point_tags)
        found += cut.irradiance.sum(axis=1)
        evaluated += float(cut.evaluated.mean()) if len(points) else 0.0
        visited += float(cut.visited.mean()) if len(points) else 0.0
    return PointErrors(point_error(found, full), evaluated, visited)


def full_irradiance(
    light_mesh: VirtualLightMesh, radiosity: Float64, points: Float64, normals: Float64, point_tags: Int32
) -> Float64:
    """(p, 3) W/m² from all lights but those that leave a point's tag out, to some 1e-4 of itself.

    Lights that are far, and wholly above the horizon, are taken at the midpoints of their edges; the others exactly.
    """
    lit = np.flatnonzero(radiosity.any(axis=1))
    result = np.zeros((len(points), 3))
    if len(lit) == 0:
        return result
    corners, tags, sent = light_mesh.corners[lit], light_mesh.tag_ids[lit], radiosity[lit]
    rows = max(1, _PAIRS_PER_BLOCK // len(lit))
    for start in range(0, len(points), rows):
        block = slice(start, start + rows)
        may = _may_light(points[block], normals[block], corners)
        left_out = leaves_out(light_mesh.links, tags, point_tags[block][:, None])
        at, of = np.nonzero(may & ~left_out)
        if len(at):
            factors = _form_factors(points[block][at], normals[block][at], corners[of])
            for channel in range(3):
                result[block, channel] += np.bincount(at, factors * sent[of, channel], len(may))
    return result


def expected_error(tree: LightTree, clusters: LightClusters, points: Float64) -> Float64:
    """(p,) W/m², sum over the channels: how far the irradiance at (p, 3) points may be off, for display.

    The model from which the windows follow: the errors of the clusters that count at a point, as if independent of
    each other. It knows no normal of the receiver, so it is the same for all surfaces through a point. An estimate,
    not a bound: see tests/core/test_light_tree_error.py for how often errors exceed it.
    """
    result = np.zeros(len(points))
    for start in range(0, len(points), _POINTS_PER_BLOCK):
        block = points[start : start + _POINTS_PER_BLOCK]
        cut = light_cut(tree, clusters.window, block)
        at, of = cut.cluster_points, cut.clusters
        counts = (clusters.power[of] > 0.0) & (facing_height(tree.shapes.take(of), block[at]) > 0.0)
        at, of, weights = at[counts], of[counts], cut.cluster_weights[counts]
        distances = np.linalg.norm(block[at] - tree.centroid[of], axis=1)
        errors = weights * cluster_error(tree, clusters, of, distances)
        result[start : start + len(block)] = np.sqrt(np.bincount(at, errors * errors, len(block)))
    return result


def _form_factors(points: Float64, normals: Float64, corners: Float64) -> Float64:
    """(m,) of pairs."""
    arms = np.ascontiguousarray((corners - points[:, None]).transpose(1, 2, 0))
    normal = np.ascontiguousarray(normals.T)
    heights = np.stack([_dot(arm, normal) for arm in arms])
    middle = (arms[0] + arms[1] + arms[2]) / 3.0
    radius_squared = np.max([_dot(arm - middle, arm - middle) for arm in arms], axis=0)
    far = (heights.min(axis=0) > 0.0) & (_dot(middle, middle) > _FAR_RADII**2 * radius_squared)
    result = np.empty(len(points))
    if not far.all():
        result[~far] = paired_form_factor(points[~far], normals[~far], corners[~far])
    a, b, c = arms[:, :, far]
    area_vector = 0.5 * np.cross(b - a, c - a, axis=0)
    total = np.zeros(a.shape[1])
    for place in (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)):
        total += _dot(place, normal[:, far]) * -_dot(place, area_vector) / _dot(place, place) ** 2
    result[far] = np.maximum(total, 0.0) / (3.0 * np.pi)
    return result


def _dot(a: Float64, b: Float64) -> Float64:
    """Of columns of (3, m) arrays."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _may_light(points: Float64, normals: Float64, corners: Float64) -> npt.NDArray[np.bool_]:
    """(p, q) False where a light clearly faces away from a point or lies under its horizon."""
    a, b, c = np.moveaxis(corners, 1, 0)
    area_vectors = np.cross(b - a, c - a)
    area_vectors /= np.maximum(np.linalg.norm(area_vectors, axis=1, keepdims=True), np.finfo(float).tiny)
    # Differences from a place amid the points and lights round less.
    middle = a.mean(axis=0)
    slack = _ROUNDING * float(max(np.abs(corners - middle).max(), np.abs(points - middle).max()))
    heights = (points - middle) @ area_vectors.T - ((a - middle) * area_vectors).sum(axis=1)
    ground = ((points - middle) * normals).sum(axis=1)[:, None]
    rises = np.zeros(heights.shape, bool)
    for corner in (a, b, c):
        rises |= normals @ (corner - middle).T - ground > -slack
    return np.asarray(rises & (heights > -slack))
