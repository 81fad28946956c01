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
from .light_tree_bounds import (
    PAIRS,
    column_cross,
    facing_height,
    horizon_height,
    place_moments,
    symmetric,
    triangle_areas,
)
from .scene import Float64

FADE = 0.2
"""A cluster's window is 1 up to a distance, and 0 from (1 + FADE) times that on."""
SOFTNESS = math.sqrt(3.0)
"""Half width of a uniform distribution, in standard deviations."""
# Error of a cluster at a distance d, as a share of power / (pi d²), found on the atrium under smooth light and under
# lamps that light from 20 to some hundreds of 100,000 lights (tests/core/test_light_cut_accuracy.py):
# _SIZE_ERROR (radius / d)^4, because four points have the lights' mean and spread but not their shape;
_SIZE_ERROR = 0.06
# _NORMAL_ERROR sqrt(1 - flux / power), because normals are not spread evenly;
_NORMAL_ERROR = 0.34
# _HORIZON_ERROR spread / d, which happens where a horizon cuts through: seldom, so not added to the others.
_HORIZON_ERROR = 0.1
# The clusters of a plain wall err alike, by _COMMON_ERROR (radius / d)^4 of what they give: at most the tolerance.
_COMMON_ERROR = 0.05
# Nearer than so many radii the four points are no longer like the lights.
_NEAREST_RADII = 1.0
# Nor nearer than this by the spread of their power: the points stand at sqrt(2) times it, which is outside of bodies
# that lie apart.
_NEAREST_SPREADS = 1.5 * math.sqrt(2.0)
_DARK = 1e-20


@dataclass(frozen=True)
class LightClusters:
    """power: (c,) W, sum over the channels. mean: (c, 3) m, of the power.

    axes: (c, 2, 3) m, along the tree's plane_axes: their products with themselves add up to the power's covariance in
    that plane. flux: (c, 3) W, power times normal. normal_spread: (c, 3, 3) W², covariance of the normals times power².
    colour: (c, 3), shares of the channels in the power. window: (c,) m, distance of the centroid up to which its lights
    count instead of it; none count from (1 + FADE) times that on. least_squared: (c,) m², what the squares of distances
    to the four points are not taken to be less than, so that no point of a cluster gives more than a light of its mean
    radiosity.
    """

    power: Float64
    mean: Float64
    axes: Float64
    flux: Float64
    normal_spread: Float64
    colour: Float64
    window: Float64
    least_squared: Float64

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in vars(self).values())


def light_clusters(
    tree: LightTree,
    light_mesh: VirtualLightMesh,
    radiosity: Float64,
    tolerance: float,
    mean_irradiance: float | None = None,
    window_factor: float = 1.0,
) -> LightClusters:
    """radiosity: (n, 3) float64, W/m², of all lights. tolerance: error of the irradiance, as a share of it.

    mean_irradiance: W/m², sum over the channels, over the surfaces that are to be lit; `room_irradiance` of the lights'
    own surfaces where it is not given. window_factor: by how much windows are larger than the error model says.
    """
    if mean_irradiance is None:
        mean_irradiance = room_irradiance(light_mesh, radiosity)
    # Near the lights, so that differences of squares keep their digits.
    origin = tree.centroid.mean(axis=0) if len(tree) else np.zeros(3)
    members = tree.light_order
    sums = tree.sums(_moments(light_mesh.vertices[light_mesh.triangles[members]] - origin, radiosity[members]))
    power, flux, mean = sums[0], sums[1:4].T, sums[4:7].T
    # What gives less than this share of all light is met as if it gave so much.
    lit = np.maximum(power, max(_DARK * float(power[tree.roots].sum()), float(np.finfo(float).tiny)))
    mean = np.where((power > 0.0)[:, None], mean / lit[:, None], tree.centroid - origin)
    spread = symmetric(sums[7:13] / lit) - np.einsum("ci,cj->cij", mean, mean)
    axes = _axes_along(spread, tree.plane_axes)
    off_centre = np.linalg.norm(mean + origin - tree.centroid, axis=1)
    return LightClusters(
        power=power,
        mean=mean + origin,
        axes=axes,
        flux=flux,
        normal_spread=lit[:, None, None] * symmetric(sums[13:19]) - np.einsum("ci,cj->cij", flux, flux),
        colour=sums[20:].T / lit[:, None],
        # A quarter of the disc that has the power at the mean radiosity of the lights, each by its power.
        least_squared=power * power / (4.0 * np.pi * np.maximum(sums[19], np.finfo(float).tiny)),
        window=_nested(
            tree, window_factor * _windows(tree, lit, flux, axes, tolerance, tolerance * mean_irradiance, off_centre)
        ),
    )


def room_irradiance(light_mesh: VirtualLightMesh, radiosity: Float64) -> float:
    """W/m², sum over the channels: mean of a closed room whose walls are the lights; radiosity: (n, 3) W/m²."""
    areas = triangle_areas(light_mesh.corners)
    return float(areas @ radiosity.sum(axis=1)) / max(float(areas.sum()), float(np.finfo(float).tiny))


def _moments(corners: Float64, radiosity: Float64) -> Float64:
    """(23, m) what each light adds to its clusters, rows as light_clusters takes them apart."""
    areas, places = place_moments(corners)
    a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    normals = 0.5 * column_cross(b - a, c - a) / np.where(areas > 0.0, areas, 1.0)
    products = [normals[i] * normals[j] for i, j in PAIRS]
    coloured = np.ascontiguousarray(radiosity.T)
    total = coloured[0] + coloured[1] + coloured[2]
    power = total * areas
    weighted = (*normals, *places, *products, total)
    return np.stack([power, *(power * row for row in weighted), *(areas * row for row in coloured)])


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
    result, smallest = np.zeros(len(rows)), float(np.sqrt(np.finfo(float).tiny))
    for k in range(4):
        towards = mean + offsets[:, k] - points
        squared = np.maximum((towards * towards).sum(-1), np.maximum(clusters.least_squared[rows], smallest))
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


def _axes_along(spread: Float64, plane_axes: Float64) -> Float64:
    """(c, 2, 3) vectors in planes, spanned by orthonormal pairs (c, 2, 3), with the planes' part of the covariances.

    spread: (c, 3, 3). The square root of a symmetric matrix changes steadily with it, unlike its principal axes.
    """
    first, second = plane_axes[:, 0], plane_axes[:, 1]
    along_first = (spread @ first[:, :, None])[:, :, 0]
    xx, xy = (along_first * first).sum(-1), (along_first * second).sum(-1)
    yy = ((spread @ second[:, :, None])[:, :, 0] * second).sum(-1)
    # Rounding may leave what is no covariance.
    xx, yy = np.maximum(xx, 0.0), np.maximum(yy, 0.0)
    xy = np.clip(xy, -np.sqrt(xx * yy), np.sqrt(xx * yy))
    root = np.sqrt(np.maximum(xx * yy - xy * xy, 0.0))
    scale = np.sqrt(np.maximum(xx + yy + 2.0 * root, np.finfo(float).tiny))
    axes = [[xx + root, xy], [xy, yy + root]]
    return np.stack([((x / scale)[:, None] * first + (y / scale)[:, None] * second) for x, y in axes], axis=1)


def cluster_error(tree: LightTree, clusters: LightClusters, rows: npt.NDArray[np.intp], distances: Float64) -> Float64:
    """(m,) W/m², sum over the channels: about what cluster rows[i] may be wrong by at distances[i] of its centroid."""
    power = np.maximum(clusters.power[rows], np.finfo(float).tiny)
    share = _SIZE_ERROR * (tree.radius[rows] / distances) ** 4 + _normal_error(power, clusters.flux[rows])
    return np.asarray(share * power / (np.pi * distances**2))


def _windows(
    tree: LightTree,
    power: Float64,
    flux: Float64,
    axes: Float64,
    tolerance: float,
    allowed: float,
    off_centre: Float64,
) -> Float64:
    """(c,) m: where a cluster's error falls to `allowed` (W/m²); that of two causes by the sum of their squares.

    off_centre: (c,) m, of the power's mean from the centroid: a lit corner may be so much nearer than the whole.
    """
    smallest = float(np.finfo(float).tiny)
    source = power / (np.pi * max(allowed, smallest))
    by_size = np.cbrt(_SIZE_ERROR * source * tree.radius**4)
    window = np.sqrt(by_size + source * _normal_error(power, flux))
    window = np.maximum(window, np.cbrt(_HORIZON_ERROR * source * _spread(axes)))
    radii = max(_NEAREST_RADII, (_COMMON_ERROR / max(tolerance, smallest)) ** 0.25)
    reach = np.maximum(radii * tree.radius, _NEAREST_SPREADS * np.linalg.norm(axes, axis=2).max(axis=1))
    return np.asarray(np.maximum(window, reach) + off_centre)


def _nested(tree: LightTree, window: Float64) -> Float64:
    """(c,) m: a parent's window reaches a cluster's window and the distance between their centroids, so that the
    parent's weight is nowhere less than the cluster's."""
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
