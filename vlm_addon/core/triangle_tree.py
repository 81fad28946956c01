# SPDX-License-Identifier: GPL-3.0-or-later
"""A bounding volume hierarchy over triangles, walked by many queries at once with array operations."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import partial

import numpy as np

from .corner_arrays import highest, lowest, middles
from .mesh_topology import Bool, Int64, sorted_with_order
from .morton import BITS_PER_AXIS, morton_codes
from .parallel import side_by_side, slices
from .progress import Report, between
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
# What a batch meets stays within a cache.
SEGMENTS_PER_BATCH = 1 << 11
# Segments longer than this share of the tree's diagonal are looked at in parts: most end in the first ones.
FAR_SHARE = 0.1
FAR_PARTS = (1.0 / 16.0, 1.0 / 4.0, 1.0)


@dataclass(frozen=True)
class Boxes:
    """low, high: (3, n) m, of which the first `filled` hold something."""

    low: Float64
    high: Float64
    filled: int

    def joined(self, count: int) -> Boxes:
        """Boxes around each `count` that follow each other; a power of two."""
        if count == 1:
            return self
        low = np.minimum(self.low[:, 0::2], self.low[:, 1::2])
        high = np.maximum(self.high[:, 0::2], self.high[:, 1::2])
        return Boxes(low, high, -(-self.filled // 2)).joined(count // 2)


@dataclass(frozen=True)
class TriangleTree:
    """A complete binary tree over triangles in Morton order.

    order: (t,) int64, triangle of each slot; leaves have LEAF_SIZE slots each. levels: root first, boxes of the nodes.
    slots: boxes of the triangles in their order, padded.
    """

    corners: Float64
    order: Int64
    levels: tuple[Boxes, ...]
    slots: Boxes

    @property
    def diagonal(self) -> float:
        """Of the box of all triangles, m; 0 for none."""
        root = self.levels[0]
        return float(np.linalg.norm(root.high - root.low)) if root.filled else 0.0

    def first_hits(
        self, origins: Float64, ends: Float64, from_behind: bool = False, report: Report = lambda share: None
    ) -> Float64:
        """(r,) fraction in (0, 1] of the way from origin to end at which each segment first meets a triangle, else inf.

        origins, ends: (r, 3). from_behind: count only triangles whose front faces away from the origin. Starting
        points that lie on a triangle do not count as hits. report: called with the share that is done, may raise.
        """
        return _first_hits(self, origins, ends, from_behind, report)[0]

    def first_met(self, origins: Float64, ends: Float64, from_behind: bool = False) -> Int64:
        """(r,) int64: the triangle that `first_hits` finds, -1 for none."""
        return self.first_met_at(origins, ends, from_behind)[0]

    def first_met_at(
        self, origins: Float64, ends: Float64, from_behind: bool = False, report: Report = lambda share: None
    ) -> tuple[Int64, Float64]:
        """`first_met` and `first_hits` of each segment."""
        fraction, met = _first_hits(self, origins, ends, from_behind, report)
        return met, fraction

    def all_met(self, origins: Float64, ends: Float64, report: Report = lambda share: None) -> tuple[Int64, Int64]:
        """(segment, triangle), each (k,) int64: all triangles that each segment meets, from either side."""

        def met(rows: slice) -> tuple[Int64, Int64]:
            segment, triangle, fraction = _met(self, origins[rows], ends[rows], False)
            hit = np.isfinite(fraction)
            return rows.start + segment[hit], triangle[hit]

        found = list(side_by_side(met, slices(len(origins), SEGMENTS_PER_BATCH), report))
        none = np.zeros(0, np.int64)
        segments, triangles = zip(*found, strict=True) if found else ((), ())
        return np.concatenate([none, *segments]), np.concatenate([none, *triangles])


def build_tree(corners: Float64) -> TriangleTree:
    """The tree of (t, 3, 3) triangles."""
    count = len(corners)
    depth = max(0, int(np.ceil(np.log2(max(count, 1) / LEAF_SIZE)))) if count > LEAF_SIZE else 0
    box_low, box_high = lowest(corners), highest(corners)
    order = _spatial_order(corners, box_low, box_high)
    low = np.full((3, LEAF_SIZE << depth), np.inf)
    high = np.full((3, LEAF_SIZE << depth), -np.inf)
    for axis in range(3):
        low[axis, :count], high[axis, :count] = box_low[order, axis], box_high[order, axis]
    slots = Boxes(low, high, count)
    levels = [slots.joined(LEAF_SIZE)]
    for _ in range(depth):
        levels.insert(0, levels[0].joined(2))
    return TriangleTree(corners, order, tuple(levels), slots)


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


def _first_hits(
    tree: TriangleTree, origins: Float64, ends: Float64, from_behind: bool, report: Report
) -> tuple[Float64, Int64]:
    nearest, met = np.full(len(origins), np.inf), np.full(len(origins), -1, np.int64)

    def look(rows: Int64, until: float) -> None:
        segment, triangle, fraction = _met(tree, origins[rows], ends[rows], from_behind, until)
        hit = np.flatnonzero(fraction <= until)
        hit = hit[np.lexsort([fraction[hit], segment[hit]])]
        hit = hit[np.diff(segment[hit], prepend=-1) > 0]
        nearest[rows[segment[hit]]], met[rows[segment[hit]]] = fraction[hit], triangle[hit]

    is_far = np.linalg.norm(ends - origins, axis=1) > FAR_SHARE * tree.diagonal
    stages = [(1.0, ~is_far), *((until, is_far) for until in FAR_PARTS)]
    for number, (until, chosen) in enumerate(stages):
        rows = np.flatnonzero(chosen & (met < 0))
        batches = [rows[part] for part in slices(len(rows), SEGMENTS_PER_BATCH)]
        done = between(report, number / len(stages), (number + 1) / len(stages))
        deque(side_by_side(partial(look, until=until), batches, done), maxlen=0)
    return nearest, met


def _met(
    tree: TriangleTree, origins: Float64, ends: Float64, from_behind: bool, until: float = 1.0
) -> tuple[Int64, Int64, Float64]:
    """(segment, triangle, fraction) where segments meet boxes of triangles; inf where not the triangle itself."""
    segment, triangle = _met_boxes(tree, origins, ends, until)
    corners = tree.corners.take(triangle, axis=0)
    return segment, triangle, _intersections(corners, origins[segment], ends[segment], from_behind)


def _met_boxes(tree: TriangleTree, origins: Float64, ends: Float64, until: float) -> tuple[Int64, Int64]:
    """(segment, triangle) of all pairs of which the segment, up to a share `until` of it, meets the triangle's box."""
    way = ends - origins
    moves = np.abs(way) > np.finfo(float).tiny
    start, inverse = origins.T.copy(), (1.0 / np.where(moves, way, 1.0)).T.copy()
    still = None if moves.all() else ~moves.T

    def meets(segment: Int64, node: Int64, boxes: Boxes) -> Bool:
        enters, leaves = np.zeros(len(segment)), np.full(len(segment), until)
        for axis in range(3):
            at, scale = start[axis].take(segment), inverse[axis].take(segment)
            below, above = boxes.low[axis].take(node) - at, boxes.high[axis].take(node) - at
            first, last = below * scale, above * scale
            if still is not None:
                rests = still[axis].take(segment)
                inside = (below <= 0.0) & (above >= 0.0)
                first = np.where(rests, np.where(inside, -np.inf, np.inf), first)
                last = np.where(rests, np.inf, last)
            np.maximum(enters, np.minimum(first, last), out=enters)
            np.minimum(leaves, np.maximum(first, last), out=leaves)
        overlap: Bool = enters <= leaves + SLAB_SLACK * (1.0 + np.abs(leaves))
        return overlap

    segment, node = np.arange(len(origins)), np.zeros(len(origins), np.int64)
    for level, boxes in enumerate(tree.levels):
        if level:
            segment, node = np.repeat(segment, 2), np.repeat(2 * node, 2)
            node[1::2] += 1
        overlap = meets(segment, node, boxes) & (node < boxes.filled)
        segment, node = segment[overlap], node[overlap]
    slot = (node[:, None] * LEAF_SIZE + np.arange(LEAF_SIZE)).ravel()
    segment = np.repeat(segment, LEAF_SIZE)
    overlap = meets(segment, slot, tree.slots) & (slot < tree.slots.filled)
    return segment[overlap], tree.order[slot[overlap]]


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
