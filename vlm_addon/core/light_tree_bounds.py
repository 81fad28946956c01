# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the lights of a cluster lie and which way they face, as bounds that lie in those of the cluster's parent.

From them follows which clusters give a point nothing at all: because every light in them faces away from it, or lies
under its horizon. Because bounds are nested, what gives nothing has only members that give nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from .scene import Float64, Int32


@dataclass(frozen=True)
class Shapes:
    """Bounds of m lights or clusters.

    area: (m,) m². centroid: (m, 3) m, of the area. radius: (m,) m, farthest corner from the centroid. low, high:
    (m, 3) m, box of the corners. axis: (m, 3) unit, cone: (m, 2), cosine and sine of the half angle of a cone about
    the axis that holds all normals. plane: (m,) m: for every corner v and every direction n in the cone that is the
    normal of its light, n · (v - centroid) is at least so much.
    """

    area: Float64
    centroid: Float64
    radius: Float64
    low: Float64
    high: Float64
    axis: Float64
    cone: Float64
    plane: Float64

    def take(self, rows: Any) -> Shapes:
        """Those of `rows`."""
        return Shapes(*(getattr(self, field.name)[rows] for field in fields(self)))


def empty_shapes(count: int = 0) -> Shapes:
    """Of nothing: areas of 0, boxes that hold no point."""
    return Shapes(
        area=np.zeros(count),
        centroid=np.zeros((count, 3)),
        radius=np.zeros(count),
        low=np.full((count, 3), np.inf),
        high=np.full((count, 3), -np.inf),
        axis=np.tile((0.0, 0.0, 1.0), (count, 1)),
        cone=np.tile((1.0, 0.0), (count, 1)),
        plane=np.zeros(count),
    )


def light_shapes(corners: Float64) -> Shapes:
    """Of single triangles, (n, 3, 3). One without area has the axis (0, 0, 1)."""
    area_vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(area_vectors, axis=1)
    axis = np.where((area > 0.0)[:, None], area_vectors / np.where(area > 0.0, area, 1.0)[:, None], (0.0, 0.0, 1.0))
    centroid = corners.mean(axis=1)
    arms = corners - centroid[:, None]
    return Shapes(
        area=area,
        centroid=centroid,
        radius=np.sqrt((arms * arms).sum(-1).max(-1)),
        low=corners.min(axis=1),
        high=corners.max(axis=1),
        axis=axis,
        cone=np.tile((1.0, 0.0), (len(corners), 1)),
        plane=np.einsum("nki,ni->nk", arms, axis).min(axis=1),
    )


def join_upwards(lights: Shapes, light_offsets: Int32, child_offsets: Int32, depths: list[slice]) -> Shapes:
    """Of all clusters. Lights in order of their clusters; offsets and depths as in LightTree."""
    shapes = empty_shapes(len(child_offsets) - 1)
    for part in depths:
        offsets = light_offsets[part.start : part.stop + 1], child_offsets[part.start : part.stop + 1]
        counts = [np.diff(each) for each in offsets]
        inner = [slice(int(each[0]), int(each[-1])) for each in offsets]
        owner = np.concatenate([np.repeat(np.arange(len(each)), each) for each in counts])
        members = [lights.take(inner[0]), shapes.take(inner[1])]
        joined = Shapes(*(np.concatenate([getattr(m, f.name) for m in members]) for f in fields(Shapes)))
        order = np.argsort(owner, kind="stable")
        starts = np.searchsorted(owner[order], np.arange(part.stop - part.start))
        found = _joined(joined.take(order), starts, owner[order])
        for field in fields(Shapes):
            getattr(shapes, field.name)[part] = getattr(found, field.name)
    return shapes


def _joined(members: Shapes, starts: npt.NDArray[np.intp], owner: npt.NDArray[np.intp]) -> Shapes:
    """Of groups of members: group i begins at starts[i]; owner: the group of each member."""
    # Lights without area still lie somewhere.
    weight = members.area + np.finfo(float).tiny
    total = np.add.reduceat(weight, starts)
    centroid = np.add.reduceat(weight[:, None] * members.centroid, starts) / total[:, None]
    low, high = np.minimum.reduceat(members.low, starts), np.maximum.reduceat(members.high, starts)
    axis = np.add.reduceat(weight[:, None] * members.axis, starts)
    length = np.linalg.norm(axis, axis=1)
    axis = np.where((length > 0.0)[:, None], axis / np.where(length > 0.0, length, 1.0)[:, None], (0.0, 0.0, 1.0))
    half = angle(members.axis, axis[owner]) + np.arctan2(members.cone[:, 1], members.cone[:, 0])
    half = np.minimum(np.maximum.reduceat(half, starts), np.pi)
    away = members.centroid - centroid[owner]
    # The least of n · away over the member's cone.
    plane = members.plane - greatest_along(-away, members.axis, members.cone)
    return Shapes(
        area=np.add.reduceat(members.area, starts),
        centroid=centroid,
        radius=np.zeros(len(starts)),
        low=low,
        high=high,
        axis=axis,
        cone=np.column_stack([np.cos(half), np.sin(half)]),
        plane=np.minimum.reduceat(plane, starts),
    )


def farthest_corners(corners: Float64, light_parent: Int32, parent: Int32, centroid: Float64) -> Float64:
    """(c,) m, distance of the farthest corner of a cluster's lights from its centroid; parents below 0 are none."""
    squared = np.zeros(len(parent))
    inside = light_parent >= 0
    # Component by component: numpy is slow where the last axis is short.
    columns, cluster = np.ascontiguousarray(corners[inside].transpose(1, 2, 0)), light_parent[inside]
    centre = np.ascontiguousarray(centroid.T)
    while len(cluster):
        x, y, z = (row[cluster] for row in centre)
        reach = [(p[0] - x) ** 2 + (p[1] - y) ** 2 + (p[2] - z) ** 2 for p in columns]
        np.maximum.at(squared, cluster, np.maximum(np.maximum(reach[0], reach[1]), reach[2]))
        cluster = parent[cluster]
        inner = cluster >= 0
        columns, cluster = columns[:, :, inner], cluster[inner]
    return np.sqrt(squared)


def angle(a: Float64, b: Float64) -> Float64:
    """(m,) rad between unit vectors (m, 3), accurate for small angles too."""
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)))


def greatest_along(vectors: Float64, axis: Float64, cone: Float64) -> Float64:
    """(m,) greatest dot product of a vector (m, 3) with a unit vector in a cone."""
    along = (vectors * axis).sum(-1)
    length = np.sqrt((vectors * vectors).sum(-1))
    across = np.sqrt(np.maximum(length * length - along * along, 0.0))
    return np.where(along >= length * cone[:, 0], length, along * cone[:, 0] + across * cone[:, 1])


def facing_height(shapes: Shapes, points: Float64) -> Float64:
    """(m,) m: no light of shape i is lower than so much under points[i] (m, 3), along its own normal.

    At most 0 where every light of it faces away.
    """
    return greatest_along(points - shapes.centroid, shapes.axis, shapes.cone) - shapes.plane


def horizon_height(shapes: Shapes, points: Float64, normals: Float64) -> Float64:
    """(m,) m: no light of shape i rises higher over the plane of points[i] and unit normals[i].

    At most 0 where every light of it is under the horizon.
    """
    centre, half = 0.5 * (shapes.low + shapes.high), 0.5 * (shapes.high - shapes.low)
    return np.asarray(((centre - points) * normals).sum(-1) + (half * np.abs(normals)).sum(-1))


PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Entries of a symmetric matrix that `place_moments` and `symmetric` go through, in this order."""


def place_moments(corners: Float64) -> tuple[Float64, Float64]:
    """(n,) areas of triangles (n, 3, 3) and (9, n) means over each of its places (3 rows) and of their products (6).

    Component by component: numpy is slow where the last axis is short.
    """
    a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    centroids = (a + b + c) / 3.0
    arms = a - centroids, b - centroids, c - centroids
    products = [sum(arm[i] * arm[j] for arm in arms) / 12.0 + centroids[i] * centroids[j] for i, j in PAIRS]
    return triangle_areas(corners), np.stack([*centroids, *products])


def triangle_areas(corners: Float64) -> Float64:
    """(n,) of (n, 3, 3)."""
    a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    x, y, z = column_cross(b - a, c - a)
    return np.asarray(0.5 * np.sqrt(x * x + y * y + z * z))


def column_cross(u: Float64, v: Float64) -> Float64:
    """(3, n) cross products of columns."""
    return np.stack([u[i] * v[j] - u[j] * v[i] for i, j in ((1, 2), (2, 0), (0, 1))])


def symmetric(rows: Float64) -> Float64:
    """(c, 3, 3) from (6, c) in the order of PAIRS."""
    matrix = np.empty((rows.shape[1], 3, 3))
    for row, (i, j) in zip(rows, PAIRS, strict=True):
        matrix[:, i, j] = matrix[:, j, i] = row
    return matrix
