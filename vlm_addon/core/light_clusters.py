# SPDX-License-Identifier: GPL-3.0-or-later
"""What the clusters of a light tree send out under given radiosities, and from where on each may stand for its lights.

Everything is a sum over lights that is linear in radiosity, so relighting is one pass up the tree. A cluster is seen as
four points that have its power's mean and spread, with normals spread about their mean as the lights' are: the mean of
max(0, cos) over normals of mean m and standard deviation s is taken from a parabola between -1.6 s and 1.6 s, which
equals that of a normal distribution at 0 and beyond.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .light_mesh import VirtualLightMesh
from .light_tree import ROOT, LightTree
from .scene import Float64

# Error of a cluster at a distance, as a share of its irradiance: (radius / distance)² + _SPREAD_ERROR x spread of its
# normals. With _ALLOWANCE x tolerance x mean irradiance for each cluster, the points' errors stay within the
# tolerance: found on the atrium under smooth light and under lamps that light a few hundred of 100,000 lights.
_SPREAD_ERROR = 30.0
_ALLOWANCE = 12.0
# Nearer than so many radii the four points are no longer like the lights.
_NEAREST_RADII = 0.7
_SOFTNESS = 1.6
_DARK = 1e-20


@dataclass(frozen=True)
class LightClusters:
    """Per cluster: power (c,) W, sum over the channels. mean: (c, 3) m, of the power. axes: (c, 2, 3) m, standard
    deviations along its two longest directions. flux: (c, 3) W, power times normal. normal_spread: (c, 3, 3) W²,
    covariance of the normals times power². colour: (c, 3), shares of the channels in the power. window: (c,) m,
    distance of the centroid up to which its lights count instead of it; half counts at 1.5 times that, none at twice.
    """

    power: Float64
    mean: Float64
    axes: Float64
    flux: Float64
    normal_spread: Float64
    colour: Float64
    window: Float64


def light_clusters(
    tree: LightTree, light_mesh: VirtualLightMesh, radiosity: Float64, tolerance: float
) -> LightClusters:
    """radiosity: (n, 3) float64, W/m². tolerance: error of the irradiance, as a share of it."""
    areas, area_vectors = light_mesh.areas, light_mesh.area_vectors
    corners = light_mesh.corners
    centroids = corners.mean(axis=1)
    total = radiosity.sum(axis=1)
    power = total * areas
    from_centroid = corners - centroids[:, None]
    second = np.einsum("nki,nkj->nij", from_centroid, from_centroid) / 12.0
    second += np.einsum("ni,nj->nij", centroids, centroids)
    normals = area_vectors / np.where(areas > 0.0, areas, 1.0)[:, None]
    # What gives less than this share of all light is met as if it gave so much.
    least = max(_DARK * float(power.sum()), float(np.finfo(float).tiny))
    lit = np.maximum(tree.sums(power), least)
    mean = tree.sums(power[:, None] * centroids) / lit[:, None]
    mean = np.where((tree.sums(power) > 0.0)[:, None], mean, tree.centroid)
    spread = tree.sums(power[:, None, None] * second) / lit[:, None, None] - np.einsum("ci,cj->cij", mean, mean)
    flux = tree.sums(power[:, None] * normals)
    products = tree.sums(power[:, None, None] * np.einsum("ni,nj->nij", normals, normals))
    return LightClusters(
        power=tree.sums(power),
        mean=mean,
        axes=_longest_axes(spread),
        flux=flux,
        normal_spread=lit[:, None, None] * products - np.einsum("ci,cj->cij", flux, flux),
        colour=tree.sums(radiosity * areas[:, None]) / lit[:, None],
        window=_windows(tree, lit, flux, float(tolerance * power.sum() / max(areas.sum(), np.finfo(float).tiny))),
    )


def cluster_irradiance(clusters: LightClusters, rows: np.ndarray, points: Float64, normals: Float64) -> Float64:
    """(m,) W/m², sum over the channels: of cluster rows[i] at points[i] (m, 3) with unit normal normals[i]."""
    power, flux = clusters.power[rows], clusters.flux[rows]
    spread, mean = clusters.normal_spread[rows], clusters.mean[rows]
    offsets = np.sqrt(2.0) * np.concatenate([clusters.axes[rows], -clusters.axes[rows]], axis=1)
    result = np.zeros(len(rows))
    for k in range(4):
        towards = mean + offsets[:, k] - points
        squared = np.maximum((towards * towards).sum(-1), np.finfo(float).tiny)
        emitted = -(towards * flux).sum(-1)
        deviation = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", towards, spread, towards), 0.0))
        received = np.maximum((towards * normals).sum(-1), 0.0)
        bound = power * np.sqrt(squared)  # no more than a light that faces the point squarely
        result += 0.25 * received * np.minimum(_softened(emitted, _SOFTNESS * deviation), bound) / squared**2
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


def _windows(tree: LightTree, power: Float64, flux: Float64, allowed: float) -> Float64:
    """(c,) m: where power / (pi d²) x the cluster's share of error falls to _ALLOWANCE x `allowed` (W/m²).

    Nested: a parent's window reaches a cluster's window and the distance between their centroids, so that the parent's
    weight is nowhere less than the cluster's.
    """
    error = np.maximum(_ALLOWANCE * allowed, np.finfo(float).tiny) * np.pi / power
    lean = _SPREAD_ERROR * (1.0 - np.linalg.norm(flux, axis=1) / power)
    # error = X (radius² X + lean) for X = 1 / d².
    inverse_squared = 2.0 * error / (lean + np.sqrt(lean * lean + 4.0 * tree.radius**2 * error))
    window = np.maximum(1.0 / np.sqrt(np.maximum(inverse_squared, np.finfo(float).tiny)), _NEAREST_RADII * tree.radius)
    for clusters in tree.levels():
        inner = clusters[tree.parent[clusters] != ROOT]
        outer = tree.parent[inner]
        apart = np.linalg.norm(tree.centroid[inner] - tree.centroid[outer], axis=1)
        np.maximum.at(window, outer, window[inner] + apart)
    return window
