# SPDX-License-Identifier: GPL-3.0-or-later
"""A bounding volume hierarchy over triangles, walked by many queries at once with array operations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .corner_arrays import highest, lowest, middles
from .mesh_topology import Bool, Int64, sorted_with_order
from .morton import BITS_PER_AXIS, morton_codes
from .parallel import side_by_side, slices
from .scene import Float64

LEAF_SIZE = 4
# A class and a place on the curve fit into one number.
MOST_CLASSES = 4
# A segment that starts on a triangle meets it at 0 up to rounding.
HIT_START = 1e-6
# A segment through an edge meets at least one of its triangles, also with rounding.
EDGE_SLACK = 1e-9
# Entering and leaving a box that is flat agree up to rounding.
SLAB_SLACK = 1e-9
SEGMENTS_PER_BATCH = 1 << 14


@dataclass(frozen=True)
class TriangleTree:
    """A complete binary tree over triangles in Morton order.

    order: (slots,) int64, triangle of each slot of the leaves, -1 for padding. lower, upper: one (nodes, 3) array per
    level, root first. triangle_lower, triangle_upper: (t, 3) box of each triangle.
    """

    corners: Float64
    order: Int64
    lower: tuple[Float64, ...]
    upper: tuple[Float64, ...]
    triangle_lower: Float64
    triangle_upper: Float64

    def first_hits(self, origins: Float64, ends: Float64, from_behind: bool = False) -> Float64:
        """(r,) fraction in (0, 1] of the way from origin to end at which each segment first meets a triangle, else inf.

        origins, ends: (r, 3). from_behind: count only triangles whose front faces away from the origin. Starting
        points that lie on a triangle do not count as hits.
        """
        return _first_hits(self, origins, ends, from_behind)[0]

    def first_met(self, origins: Float64, ends: Float64, from_behind: bool = False) -> Int64:
        """(r,) int64: the triangle that `first_hits` finds, -1 for none."""
        return self.first_met_at(origins, ends, from_behind)[0]

    def first_met_at(self, origins: Float64, ends: Float64, from_behind: bool = False) -> tuple[Int64, Float64]:
        """`first_met` and `first_hits` of each segment."""
        fraction, met = _first_hits(self, origins, ends, from_behind)
        return met, fraction

    def all_met(self, origins: Float64, ends: Float64) -> tuple[Int64, Int64]:
        """(segment, triangle), each (k,) int64: all triangles that each segment meets, from either side."""

        def met(rows: slice) -> tuple[Int64, Int64]:
            segment, triangle, fraction = _met(self, origins[rows], ends[rows], False)
            hit = np.isfinite(fraction)
            return rows.start + segment[hit], triangle[hit]

        found = list(side_by_side(met, slices(len(origins), SEGMENTS_PER_BATCH)))
        none = np.zeros(0, np.int64)
        segments, triangles = zip(*found, strict=True) if found else ((), ())
        return np.concatenate([none, *segments]), np.concatenate([none, *triangles])


def build_tree(corners: Float64) -> TriangleTree:
    """The tree of (t, 3, 3) triangles."""
    count = len(corners)
    levels = max(0, int(np.ceil(np.log2(max(count, 1) / LEAF_SIZE)))) if count > LEAF_SIZE else 0
    order = np.full(LEAF_SIZE << levels, -1, np.int64)
    box_low, box_high = lowest(corners), highest(corners)
    order[:count] = _spatial_order(corners, box_low, box_high)
    low = np.full((len(order), 3), np.inf)
    high = np.full((len(order), 3), -np.inf)
    low[:count], high[:count] = box_low.take(order[:count], axis=0), box_high.take(order[:count], axis=0)
    lower, upper = [low], [high]
    for _ in range(int(np.log2(LEAF_SIZE)) + levels):
        lower.insert(0, np.minimum(lower[0][0::2], lower[0][1::2]))
        upper.insert(0, np.maximum(upper[0][0::2], upper[0][1::2]))
    lower, upper = lower[: levels + 1], upper[: levels + 1]
    return TriangleTree(corners, order, tuple(lower), tuple(upper), box_low, box_high)


def _spatial_order(corners: Float64, low: Float64, high: Float64) -> Int64:
    """Triangles by size class, those of a class along the Z-order curve."""
    classes, code = _size_classes(low, high), morton_codes(middles(corners))
    most = int(classes.max(initial=0))
    if most >= MOST_CLASSES:
        return np.lexsort([code, classes])
    return sorted_with_order((classes << 3 * BITS_PER_AXIS) | code, (most + 1) << 3 * BITS_PER_AXIS)[1]


def _size_classes(low: Float64, high: Float64) -> Int64:
    """(t,): how many times each triangle is four times as large as the median. One wall would swell the boxes of all
    small triangles near its middle, so large ones get branches of their own."""
    extent = highest(high - low)
    median = float(np.median(extent)) if len(extent) else 0.0
    ratio = extent / (median if median > 0 else 1.0)
    classes: Int64 = np.floor(0.5 * np.log2(np.maximum(ratio, 1.0))).astype(np.int64)
    return classes


def _first_hits(tree: TriangleTree, origins: Float64, ends: Float64, from_behind: bool) -> tuple[Float64, Int64]:
    nearest, met = np.full(len(origins), np.inf), np.full(len(origins), -1, np.int64)

    def look(rows: slice) -> None:
        segment, triangle, fraction = _met(tree, origins[rows], ends[rows], from_behind)
        hit = np.flatnonzero(np.isfinite(fraction))
        hit = hit[np.lexsort([fraction[hit], segment[hit]])]
        hit = hit[np.diff(segment[hit], prepend=-1) > 0]
        nearest[rows][segment[hit]] = fraction[hit]
        met[rows][segment[hit]] = triangle[hit]

    for _ in side_by_side(look, slices(len(origins), SEGMENTS_PER_BATCH)):
        pass
    return nearest, met


def _met(tree: TriangleTree, origins: Float64, ends: Float64, from_behind: bool) -> tuple[Int64, Int64, Float64]:
    """(segment, triangle, fraction) where segments meet boxes of triangles; inf where not the triangle itself."""
    segment, triangle = _met_boxes(tree, origins, ends)
    corners = tree.corners.take(triangle, axis=0)
    return segment, triangle, _intersections(corners, origins[segment], ends[segment], from_behind)


def _met_boxes(tree: TriangleTree, origins: Float64, ends: Float64) -> tuple[Int64, Int64]:
    """(segment, triangle) of all pairs of which the segment meets the triangle's box."""
    low, high = np.minimum(origins, ends), np.maximum(origins, ends)
    way = ends - origins
    # Along an axis on which a segment does not move, the box test alone decides: any finite inverse will do.
    inverse = 1.0 / np.where(np.abs(way) > np.finfo(float).tiny, way, 1.0)
    moves = np.abs(way) > np.finfo(float).tiny

    def meets(segment: Int64, box_low: Float64, box_high: Float64) -> Bool:
        overlap = (low[segment] <= box_high).all(axis=1) & (high[segment] >= box_low).all(axis=1)
        near = np.flatnonzero(overlap)
        row = segment[near]
        first, last = (box_low[near] - origins[row]) * inverse[row], (box_high[near] - origins[row]) * inverse[row]
        enters = np.where(moves[row], np.minimum(first, last), -np.inf).max(axis=1)
        leaves = np.where(moves[row], np.maximum(first, last), np.inf).min(axis=1)
        overlap[near] = enters <= leaves + SLAB_SLACK * (1.0 + np.abs(leaves))
        return overlap

    segment, node = np.arange(len(origins)), np.zeros(len(origins), np.int64)
    for level, (node_low, node_high) in enumerate(zip(tree.lower, tree.upper, strict=True)):
        if level:
            segment, node = np.repeat(segment, 2), np.repeat(2 * node, 2)
            node[1::2] += 1
        overlap = meets(segment, node_low[node], node_high[node])
        segment, node = segment[overlap], node[overlap]
    triangle = tree.order.reshape(-1, LEAF_SIZE)[node]
    segment = np.repeat(segment, LEAF_SIZE)[triangle.ravel() >= 0]
    triangle = triangle[triangle >= 0]
    overlap = meets(segment, tree.triangle_lower[triangle], tree.triangle_upper[triangle])
    return segment[overlap], triangle[overlap]


def _intersections(corners: Float64, origin: Float64, end: Float64, from_behind: bool) -> Float64:
    """Fraction along each segment where it meets its triangle, else inf (Moeller and Trumbore 1997)."""
    direction = end - origin
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, ac)
    determinant = np.einsum("ij,ij->i", ab, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / determinant
        t = origin - corners[:, 0]
        u = np.einsum("ij,ij->i", t, p) * inverse
        q = np.cross(t, ab)
        v = np.einsum("ij,ij->i", direction, q) * inverse
        fraction = np.einsum("ij,ij->i", ac, q) * inverse
        hit = (u >= -EDGE_SLACK) & (v >= -EDGE_SLACK) & (u + v <= 1 + EDGE_SLACK)
        hit &= (fraction > HIT_START) & (fraction <= 1)
    if from_behind:
        # determinant = -direction . (ab x ac): negative where the segment leaves through the back of the front.
        hit &= determinant < 0
    return np.where(hit, fraction, np.inf)
