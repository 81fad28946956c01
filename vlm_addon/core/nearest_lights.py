# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that each triangle of the visible surface most likely belongs to, where no map of regions is known.

The nearest light counts, in place and in direction: least squared distance from the middle of the triangle to the
light, plus the light's area times 1 - cosine between their normals, so that the two sides of a thin body stay apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .corner_arrays import highest, lowest, middles
from .light_mesh import VirtualLightMesh
from .mesh_topology import Int64, Rows, normals_and_areas
from .morton import morton_codes
from .parallel import side_by_side, slices
from .progress import Report
from .scene import Float64, Int32, Mesh
from .triangle_distance import FlatTriangles, flat_triangles

# Triangles that look for candidates together, level by level.
BLOCKS = (1024, 256, 64, 16, 4)
# Triangles that are looked at side by side with others.
TRIANGLES_PER_BATCH = 1 << 14
# Pairs of a block or triangle and a light that are held at once.
PAIRS_PER_BATCH = 1 << 17
# What rounding may take from a bound, and from the part of it that is due to angles, as a share of a light's area.
SLACK = 1e-9
ANGLE_SLACK = 1e-7


def pair_nearest(light_mesh: VirtualLightMesh, meshes: Sequence[Mesh]) -> tuple[Int32, ...]:
    """For each mesh, (its triangles,) int32: the row of the light nearest to each triangle, -1 where there is none."""
    corners = [mesh.positions[mesh.triangles] for mesh in meshes]
    counts = [len(each) for each in corners]
    if not sum(counts):
        return tuple(np.zeros(0, np.int32) for _ in meshes)
    lights = light_of_triangles(light_mesh.corners, np.concatenate(corners))
    return tuple(np.split(lights, np.cumsum(counts)[:-1]))


def light_of_triangles(light_corners: Float64, source_corners: Float64, report: Report = lambda share: None) -> Int32:
    """(t,) int32: the nearest of the lights (n, 3, 3) for each triangle (t, 3, 3), -1 without lights.

    report: called with the share of the work that is done, may raise.
    """
    nearest = np.full(len(source_corners), -1, np.int32)
    if not len(light_corners) or not len(source_corners):
        return nearest
    middle, normal = middles(source_corners), normals_and_areas(source_corners)[0]
    axis = np.abs(normal).argmax(axis=1)
    side = 2 * axis + (normal[np.arange(len(normal)), axis] < 0)
    order = np.lexsort([morton_codes(middle), side])
    lights = _Lights.of(light_corners)
    batches = [order[part] for part in slices(len(order), TRIANGLES_PER_BATCH)]

    def look(rows: Int64) -> Int32:
        return _nearest(lights, middle[rows], normal[rows])

    for rows, found in zip(batches, side_by_side(look, batches, report), strict=True):
        nearest[rows] = found
    return nearest


@dataclass(frozen=True)
class _Lights:
    """Lights; low, high, middle, normal: (3, n), a row for each axis."""

    flat: FlatTriangles
    low: Float64
    high: Float64
    middle: Float64
    normal: Float64
    area: Float64

    @staticmethod
    def of(corners: Float64) -> _Lights:
        normal, area = normals_and_areas(corners)
        low, high, middle = lowest(corners).T.copy(), highest(corners).T.copy(), middles(corners).T.copy()
        return _Lights(flat_triangles(corners), low, high, middle, normal.T.copy(), area)


def _nearest(lights: _Lights, middle: Float64, normal: Float64) -> Int32:
    """The nearest light of each triangle; those that follow each other in blocks lie together and face alike."""
    pairs = Rows(np.arange(len(lights.area)), np.array([0, len(lights.area)]))
    parent_size = len(middle)
    for size in BLOCKS:
        starts = np.arange(0, len(middle), size)
        box = _Boxes.of(middle, normal, starts)
        pairs = _narrowed(lights, box, pairs, starts // parent_size)
        parent_size = size
    nearest = np.empty(len(middle), np.int32)
    parent = np.arange(len(middle)) // parent_size
    for rows in _batches(pairs.lengths[parent]):
        nearest[rows] = _exact(lights, middle[rows], normal[rows], pairs, parent[rows])
    return nearest


@dataclass(frozen=True)
class _Boxes:
    """Blocks of points: corners of their boxes, and a cone around their normals; (3, b), a row for each axis. cosine,
    sine: (b,) of the half angle of the cone."""

    low: Float64
    high: Float64
    axis: Float64
    cosine: Float64
    sine: Float64

    @staticmethod
    def of(middle: Float64, normal: Float64, starts: Int64) -> _Boxes:
        axis = np.add.reduceat(normal, starts)
        length = np.linalg.norm(axis, axis=1, keepdims=True)
        axis = np.divide(axis, length, out=np.zeros_like(axis), where=length > 0)
        lengths = np.diff(np.append(starts, len(middle)))
        cosine = np.einsum("ij,ij->i", normal, np.repeat(axis, lengths, axis=0))
        cosine = np.clip(np.minimum.reduceat(cosine, starts), -1.0, 1.0)
        low, high = np.minimum.reduceat(middle, starts), np.maximum.reduceat(middle, starts)
        return _Boxes(low.T.copy(), high.T.copy(), axis.T.copy(), cosine, np.sqrt(1.0 - cosine * cosine))


def _narrowed(lights: _Lights, box: _Boxes, pairs: Rows, parent: Int64) -> Rows:
    """Of the lights of each block's parent, those that may be the nearest of some point of the block."""
    kept_light, count = [], np.zeros(len(parent), np.int64)
    for rows in _batches(pairs.lengths[parent]):
        owner, light = pairs.expand(parent[rows])
        row = rows[owner]
        least, most = _distance_bounds(lights, box, light, row)
        nearest, farthest = _turn_bounds(lights, box, light, row)
        area = lights.area.take(light)
        least += (nearest - ANGLE_SLACK) * area
        most += (farthest + ANGLE_SLACK) * area
        keep = least <= _least_of_each(most, owner).take(owner) * (1.0 + SLACK)
        kept_light.append(light[keep])
        count[rows] = np.bincount(owner[keep], minlength=len(rows))
    return Rows(np.concatenate(kept_light), np.concatenate([[0], np.cumsum(count)]))


def _distance_bounds(lights: _Lights, box: _Boxes, light: Int64, row: Int64) -> tuple[Float64, Float64]:
    """(p,) each: at least and at most the squared distance between any point of box `row` and the light beside it."""
    least, most = np.zeros(len(light)), np.zeros(len(light))
    for axis in range(3):
        low, high = box.low[axis].take(row), box.high[axis].take(row)
        gap = np.maximum(lights.low[axis].take(light) - high, low - lights.high[axis].take(light))
        np.maximum(gap, 0.0, out=gap)
        least += gap * gap
        middle = lights.middle[axis].take(light)
        way = np.maximum(high - middle, middle - low)
        most += way * way
    return least, most


def _turn_bounds(lights: _Lights, box: _Boxes, light: Int64, row: Int64) -> tuple[Float64, Float64]:
    """(p,) each: at least and at most 1 - cosine between any normal of block `row` and that of the light beside it."""
    cosine = sum(lights.normal[axis].take(light) * box.axis[axis].take(row) for axis in range(3))
    cosine = np.minimum(np.maximum(cosine, -1.0), 1.0)
    spread, across = box.cosine.take(row), box.sine.take(row)
    along, aside = cosine * spread, np.sqrt(1.0 - cosine * cosine) * across
    # Cosines of the difference and the sum of both angles, unless it is below 0 or above 180 degrees.
    least = np.where(cosine >= spread, 0.0, 1.0 - (along + aside))
    most = np.where(cosine <= -spread, 2.0, 1.0 - (along - aside))
    return least, most


def _exact(lights: _Lights, middle: Float64, normal: Float64, pairs: Rows, parent: Int64) -> Int64:
    owner, light = pairs.expand(parent)
    # Rounding of unit normals may give cosines above 1, and a negative least score would keep no light at all.
    cosine = np.minimum(np.einsum("ij,ij->i", normal.take(owner, axis=0), lights.normal.T.take(light, axis=0)), 1.0)
    turned = (1.0 - cosine) * lights.area.take(light)
    least, most = turned.copy(), turned.copy()
    for axis in range(3):
        at = np.ascontiguousarray(middle[:, axis]).take(owner)
        gap = np.maximum(lights.low[axis].take(light) - at, at - lights.high[axis].take(light))
        np.maximum(gap, 0.0, out=gap)
        least += gap * gap
        way = at - lights.middle[axis].take(light)
        most += way * way
    keep = least <= _least_of_each(most, owner).take(owner) * (1.0 + SLACK)
    owner, light, turned = owner[keep], light[keep], turned[keep]
    score = lights.flat.squared_distances(middle.take(owner, axis=0), light) + turned
    best = np.flatnonzero(score == _least_of_each(score, owner)[owner])
    return light[best[np.searchsorted(owner[best], np.arange(len(middle)))]]


def _least_of_each(values: Float64, owner: Int64) -> Float64:
    """The least value of each owner; owners ascend from 0, none is left out."""
    least: Float64 = np.minimum.reduceat(values, np.flatnonzero(np.diff(owner, prepend=-1)))
    return least


def _batches(lengths: Int64) -> Iterator[Int64]:
    """Runs of rows with about PAIRS_PER_BATCH entries together."""
    batch = np.cumsum(lengths) // PAIRS_PER_BATCH
    at = np.flatnonzero(np.diff(batch)) + 1
    yield from np.split(np.arange(len(lengths)), at)
