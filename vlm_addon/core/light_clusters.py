# SPDX-License-Identifier: GPL-3.0-or-later
"""What the clusters of a light tree send out under given radiosities, and from where on each may stand for its lights.

Everything is a sum over lights that is linear in radiosity, so relighting is one pass up the tree. A cluster is seen as
four points that have its power's mean and spread, with normals spread about their mean as the lights' are: the mean of
max(0, cos) over cosines of mean m and standard deviation s is that of a uniform distribution, a parabola between
-sqrt(3) s and sqrt(3) s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .light_tree import ROOT, LightTree
from .light_tree_bounds import facing_height, horizon_height
from .scene import Float64

FADE = 0.2
"""A cluster's window is 1 up to a distance, and 0 from (1 + FADE) times that on."""
SOFTNESS = math.sqrt(3.0)
"""Half width of a uniform distribution, in standard deviations."""
# Error of a cluster at a distance d, as a share of power / (pi d²), found on the atrium under smooth light and under
# lamps that light from 20 to some hundreds of 100,000 lights (tests/core/test_light_cut_accuracy.py):
# _SIZE_ERROR (radius / d)^4, because four points have the lights' mean and spread but not their shape;
_SIZE_ERROR = 0.12
# _NORMAL_ERROR sqrt(1 - flux / power), because normals are not spread evenly;
_NORMAL_ERROR = 0.42
# _HORIZON_ERROR spread / d, which happens where a horizon cuts through: seldom, so not added to the others.
_HORIZON_ERROR = 0.05
# Nearer than so many radii the four points are no longer like the lights.
_NEAREST_RADII = 1.2
_DARK = 1e-20


@dataclass(frozen=True)
class LightClusters:
    """Per cluster: power (c,) W, sum over the channels. mean: (c, 3) m, of the power. axes: (c, 2, 3) m, standard
    deviations along its two longest directions. flux: (c, 3) W, power times normal. normal_spread: (c, 3, 3) W²,
    covariance of the normals times power². colour: (c, 3), shares of the channels in the power. window: (c,) m,
    distance of the centroid up to which its lights count instead of it; none count from (1 + FADE) times that on.
    least_squared: (c,) m², what the squares of distances to the four points are not taken to be less than, so that no
    point of a cluster gives more than a light of its mean radiosity.
    """

    power: Float64
    mean: Float64
    axes: Float64
    flux: Float64
    normal_spread: Float64
    colour: Float64
    window: Float64
    least_squared: Float64


def light_clusters(
    tree: LightTree, light_mesh: VirtualLightMesh, radiosity: Float64, tolerance: float
) -> LightClusters:
    """radiosity: (n, 3) float64, W/m². tolerance: error of the irradiance, as a share of it."""
    areas = light_mesh.areas
    # Near the lights, so that differences of squares keep their digits.
    origin = tree.centroid.mean(axis=0) if len(tree) else np.zeros(3)
    sums = tree.sums(_moments(light_mesh.corners - origin, light_mesh.area_vectors, radiosity))
    power, flux, mean = sums[0], sums[1:4].T, sums[16:19].T
    total_power, total_area = float(areas @ radiosity.sum(axis=1)), float(areas.sum())
    # What gives less than this share of all light is met as if it gave so much.
    lit = np.maximum(power, max(_DARK * total_power, float(np.finfo(float).tiny)))
    mean = np.where((power > 0.0)[:, None], mean / lit[:, None], tree.centroid - origin)
    spread = _symmetric(sums[4:10] / lit) - np.einsum("ci,cj->cij", mean, mean)
    axes = _longest_axes(spread)
    mean_radiosity = total_power / max(total_area, float(np.finfo(float).tiny))
    return LightClusters(
        power=power,
        mean=mean + origin,
        axes=axes,
        flux=flux,
        normal_spread=lit[:, None, None] * _symmetric(sums[10:16]) - np.einsum("ci,cj->cij", flux, flux),
        colour=sums[20:].T / lit[:, None],
        # A quarter of the disc that has the power at the mean radiosity of the lights, each by its power.
        least_squared=lit * lit / (4.0 * np.pi * np.maximum(sums[19], np.finfo(float).tiny)),
        window=_windows(tree, lit, flux, axes, tolerance * mean_radiosity),
    )


_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _moments(corners: Float64, area_vectors: Float64, radiosity: Float64) -> Float64:
    """(23, n) what each light adds to its clusters: rows in the order in which light_clusters takes them apart."""
    areas = np.linalg.norm(area_vectors, axis=1)
    corners, coloured = corners.transpose(1, 2, 0), radiosity.T * areas
    centroids = corners.mean(axis=0)
    arms = corners - centroids
    normals = area_vectors.T / np.where(areas > 0.0, areas, 1.0)
    power = coloured.sum(axis=0)
    places = [(arms[:, i] * arms[:, j]).sum(axis=0) / 12.0 + centroids[i] * centroids[j] for i, j in _PAIRS]
    products = [normals[i] * normals[j] for i, j in _PAIRS]
    weighted = (*normals, *places, *products, *centroids, radiosity.sum(axis=1))
    return np.stack([power, *(power * row for row in weighted), *coloured])


def _symmetric(rows: Float64) -> Float64:
    """(c, 3, 3) from (6, c) in the order of _PAIRS."""
    matrix = np.empty((rows.shape[1], 3, 3))
    for row, (i, j) in zip(rows, _PAIRS, strict=True):
        matrix[:, i, j] = matrix[:, j, i] = row
    return matrix


def cluster_irradiance(
    tree: LightTree, clusters: LightClusters, rows: npt.NDArray[np.intp], points: Float64, normals: Float64
) -> Float64:
    """(m,) W/m², sum over the channels: of cluster rows[i] at points[i] (m, 3) with unit normal normals[i].

    Exactly 0 where no light of the cluster faces the point or rises over its horizon, and continuous there.
    """
    power, flux = clusters.power[rows], clusters.flux[rows]
    spread, mean = clusters.normal_spread[rows], clusters.mean[rows]
    offsets = np.sqrt(2.0) * np.concatenate([clusters.axes[rows], -clusters.axes[rows]], axis=1)
    shapes = tree.shapes.take(rows)
    highest = np.maximum(horizon_height(shapes, points, normals), 0.0)
    facing = np.maximum(facing_height(shapes, points), 0.0)
    result = np.zeros(len(rows))
    for k in range(4):
        towards = mean + offsets[:, k] - points
        squared = np.maximum((towards * towards).sum(-1), clusters.least_squared[rows])
        emitted = -(towards * flux).sum(-1)
        deviation = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", towards, spread, towards), 0.0))
        received = np.clip((towards * normals).sum(-1), 0.0, highest)
        # No more than if all of it faced the point squarely, or as its most inclined light does.
        bound = power * np.minimum(np.sqrt(squared), facing)
        result += 0.25 * received * np.minimum(_softened(emitted, SOFTNESS * deviation), bound) / squared**2
    return result / np.pi


def _softened(value: Float64, width: Float64) -> Float64:
    """max(0, value), rounded off by a parabola within `width`."""
    width = np.maximum(width, np.finfo(float).tiny)
    inside = np.clip(value + width, 0.0, 2.0 * width)
    return np.where(value > width, value, inside * (inside / (4.0 * width)))


def _longest_axes(spread: Float64) -> Float64:
    """(c, 2, 3) square roots of the two greatest principal parts of symmetric matrices (c, 3, 3)."""
    values, vectors = np.linalg.eigh(spread)
    return np.stack([np.sqrt(np.maximum(values[:, k], 0.0))[:, None] * vectors[:, :, k] for k in (2, 1)], axis=1)


def _windows(tree: LightTree, power: Float64, flux: Float64, axes: Float64, allowed: float) -> Float64:
    """(c,) m: where a cluster's error falls to `allowed` (W/m²); that of two causes by the sum of their squares.

    Nested: a parent's window reaches a cluster's window and the distance between their centroids, so that the parent's
    weight is nowhere less than the cluster's.
    """
    source = power / (np.pi * max(allowed, float(np.finfo(float).tiny)))
    by_size = np.cbrt(_SIZE_ERROR * source * tree.radius**4)
    window = np.sqrt(by_size + source * _normal_error(power, flux))
    window = np.maximum(window, np.cbrt(_HORIZON_ERROR * source * _spread(axes)))
    window = np.maximum(window, _NEAREST_RADII * tree.radius)
    for part in tree.depths():
        outer = tree.parent[part]
        if outer[0] != ROOT:
            apart = np.linalg.norm(tree.centroid[part] - tree.centroid[outer], axis=1)
            np.maximum.at(window, outer, window[part] + apart)
    return window


def _normal_error(power: Float64, flux: Float64) -> Float64:
    lean = 1.0 - np.linalg.norm(flux, axis=1) / power
    return np.asarray(_NORMAL_ERROR * np.sqrt(np.maximum(lean, 0.0)))


def _spread(axes: Float64) -> Float64:
    """(c,) m: half the diagonal of a square whose standard deviations are those along the axes."""
    return np.asarray(np.sqrt(3.0 * (axes * axes).sum(axis=(1, 2))))
