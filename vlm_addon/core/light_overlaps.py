# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that get in each other's way: neighbours that face against each other, and lights that lie on others."""

from __future__ import annotations

import numpy as np

from .light_marks import UNMARKED, made_together
from .light_mesh import SourceSamples, VirtualLightMesh
from .mesh_topology import Bool, Int64, Rows, connected_components, half_edges, rows_by_key, sum_by
from .progress import Report
from .scene import Float64, Int32
from .triangle_tree import build_tree

# Cosine from which two lights face alike.
SIMILAR_COSINE = 0.8
# Heights over a light that are one, in sizes (square root of the area) of the light.
NEAR_SIZES = 1e-3
# Share of a light's source samples that others must have, too, for its bounce to count twice.
COVERED_SHARE = 0.6
# A point among the samples of a region is at most so many spacings away from the nearest.
NEIGHBOUR_SPACINGS = 0.5
PAIRS_PER_BATCH = 1 << 14


def badly_joined(light_mesh: VirtualLightMesh) -> Bool:
    """(n,) lights that share an edge with another in the same direction, so one of the two faces the wrong way.

    Of the two, the one that faces away from its source samples, or else, of a whole surface, the fewer.
    """
    wrong = np.zeros(len(light_mesh), bool)
    triangles = light_mesh.triangles.astype(np.int64)
    solid = np.flatnonzero((triangles != np.roll(triangles, 1, axis=1)).all(axis=1))
    if not len(solid):
        return wrong
    edges = half_edges(triangles[solid], len(light_mesh.vertices))
    start = triangles[solid].ravel()
    order = np.argsort(edges.edge, kind="stable")
    pair = np.flatnonzero(edges.face_count == 2)
    first = np.searchsorted(edges.edge[order], pair)
    one, other = order[first], order[first + 1]
    alike = start[one] == start[other]
    if not alike.any():
        return wrong
    turned = _turned(len(solid), one // 3, other // 3, alike)
    facing = _facing(light_mesh)[solid]
    group, side = turned
    for parity in (0, 1):
        weight = sum_by(group, np.where(side == parity, facing, -facing), int(group.max()) + 1)
        count = sum_by(group, np.where(side == parity, 1.0, -1.0), int(group.max()) + 1)
        right = (weight > 0) | ((weight == 0) & ((count > 0) | ((count == 0) & (parity == 0))))
        wrong[solid[(side != parity) & right[group]]] = True
    return wrong


def _turned(count: int, one: Int64, other: Int64, alike: Bool) -> tuple[Int64, Int64]:
    """(group, side 0 or 1): lights joined by edges, on one side those that agree with the first of their group.

    A graph of 2 n nodes, (light, side): an edge that runs the same way in both joins opposite sides.
    """
    node = np.concatenate([one, one + count])
    to = np.concatenate([np.where(alike, other + count, other), np.where(alike, other, other + count)])
    _, label = connected_components(2 * count, node, to)
    group = np.minimum(label[:count], label[count:])
    side = (label[:count] != group).astype(np.int64)
    # Where both sides are joined (a Moebius strip), nothing can be told: all count as agreeing.
    side[label[:count] == label[count:]] = 0
    _, group = np.unique(group, return_inverse=True)
    return group, side


def _facing(light_mesh: VirtualLightMesh) -> Float64:
    """(n,) mean cosine between each light and its source samples, 0 without any, times its area."""
    samples = light_mesh.samples
    owner = np.repeat(np.arange(len(light_mesh)), np.diff(samples.offsets))
    cosine = np.einsum("ij,ij->i", samples.normals, light_mesh.area_vectors[owner]) * samples.weights
    return sum_by(owner, cosine, len(light_mesh))


def covered_twice(
    light_mesh: VirtualLightMesh, report: Report = lambda share: None, marks: Int32 | None = None
) -> Bool:
    """(n,) lights of which at least COVERED_SHARE of the source samples belong to others, too; of several that cover
    each other, the largest and first stays. report: called with the share of the work that is done, may raise.

    marks: (n,) int32 (light_marks.py). Lights that were made together do not count twice, however they lie: few lights
    of many small bodies lie across each other.
    """
    size = np.sqrt(light_mesh.areas)
    count = len(light_mesh)
    marks = np.full(count, UNMARKED, np.int32) if marks is None else marks
    light, above, weight = _covering_pairs(light_mesh, size, marks, report)
    twice = np.zeros(count, bool)
    if not len(light):
        return twice
    keys, place = np.unique(light * count + above, return_inverse=True)
    light, above, weight = keys // count, keys % count, sum_by(place, weight, len(keys))
    covered = sum_by(light, weight, count)
    of_light = rows_by_key(light, count)
    covers = rows_by_key(above, count)
    candidates = np.flatnonzero((of_light.lengths > 0) & (covered >= COVERED_SHARE))
    # Smallest and last first: what is taken away covers nothing any more.
    for row in candidates[np.lexsort([-candidates, _rounded(size[candidates])])]:
        if covered[row] >= COVERED_SHARE:
            twice[row] = True
            gone = covers.values[covers.starts[row] : covers.starts[row + 1]]
            covered[light[gone]] -= weight[gone]
    return twice


def _rounded(sizes: Float64) -> Float64:
    """Sizes that differ by rounding alone are one."""
    with np.errstate(divide="ignore"):
        rounded: Float64 = np.round(np.log2(sizes), 6)
    return rounded


def _covering_pairs(
    light_mesh: VirtualLightMesh, size: Float64, marks: Int32, report: Report
) -> tuple[Int64, Int64, Float64]:
    """(light, other, weight of the sample) for every source sample of a light that lies in the region of another, too:
    behind it is the other, facing alike, and it is as high above that one's plane as that one's own samples are."""
    samples, corners = light_mesh.samples, light_mesh.corners
    count = len(light_mesh)
    normal = light_mesh.area_vectors / np.where(size > 0, size**2, 1.0)[:, None]
    owner = np.repeat(np.arange(count), np.diff(samples.offsets))
    height = np.einsum("ij,ij->i", samples.positions - corners[owner, 0], normal[owner])
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, owner, height)
    np.maximum.at(high, owner, height)
    near = NEAR_SIZES * size
    reach = np.maximum(np.where(high > -np.inf, high, 0.0), 0.0) + near
    ahead = np.maximum(np.where(low < np.inf, -low, 0.0), 0.0) + near
    start = samples.positions + ahead[owner, None] * normal[owner]
    end = samples.positions - reach[owner, None] * normal[owner]
    segment, met = build_tree(corners).all_met(start, end, report)
    light = owner[segment]
    chosen = (light != met) & (np.einsum("ij,ij->i", normal[light], normal[met]) > SIMILAR_COSINE)
    chosen &= ~made_together(marks[light], marks[met])
    segment, light, met = segment[chosen], light[chosen], met[chosen]
    above = np.einsum("ij,ij->i", samples.positions[segment] - corners[met, 0], normal[met])
    chosen = (above > low[met] - near[met]) & (above < high[met] + near[met])
    segment, light, met = segment[chosen], light[chosen], met[chosen]
    # Copies of one light have one region.
    chosen = (marks[light] == marks[met]) & (marks[light] != UNMARKED)
    chosen[~chosen] = _among_samples(samples, segment[~chosen], met[~chosen])
    return light[chosen], met[chosen], samples.weights[segment[chosen]].astype(np.float64)


def _among_samples(samples: SourceSamples, point: Int64, light: Int64) -> Bool:
    """(k,) whether each sample lies as near to one of the samples of the light beside it as these to each other."""
    counts = np.diff(samples.offsets)
    every = Rows(np.arange(len(samples.positions)), samples.offsets.astype(np.int64))
    near = np.zeros(len(point), bool)
    spacing = _spacings(samples, counts)
    for first in range(0, len(point), PAIRS_PER_BATCH):
        rows = slice(first, first + PAIRS_PER_BATCH)
        owner, other = every.expand(light[rows])
        square = ((samples.positions[point[rows]][owner] - samples.positions[other]) ** 2).sum(axis=1)
        close = square <= (NEIGHBOUR_SPACINGS * spacing[light[rows]][owner]) ** 2
        near[rows] = np.bincount(owner, weights=close, minlength=len(near[rows])) > 0
    return near


def _spacings(samples: SourceSamples, counts: Int64) -> Float64:
    """(n,) m: side of the square that each sample of a light stands for, by the spread of the samples."""
    owner = np.repeat(np.arange(len(counts)), counts)
    each = np.maximum(counts, 1)
    mean = np.stack([sum_by(owner, samples.positions[:, axis], len(counts)) / each for axis in range(3)], axis=1)
    square = sum_by(owner, ((samples.positions - mean[owner]) ** 2).sum(axis=1), len(counts)) / each
    # Uniform over a square of side a, the mean square distance from its middle is a^2 / 6.
    return np.sqrt(6.0 * square / each)
