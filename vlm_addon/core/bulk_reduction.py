# SPDX-License-Identifier: GPL-3.0-or-later
"""The first, rough part of a large reduction, by fast_simplification; edge_collapse.py does the fine part.

fast_simplification is some fifty times as fast as array operations can be, but it looks at neither borders between
materials nor topology. So it gets one material group at a time (all borders locked), is stopped far above the final
count, and where its result is not the manifold it was given, the triangles around the fault are kept out of a second
run. Its collapses are replayed here instead of by its own replay function, which also drops isolated points one by
one in a Python loop: a vertex goes where its chain of collapses ends.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np

from .corner_arrays import middles
from .mesh_topology import (
    Bool,
    Int64,
    cut_to_manifold,
    fans_apart,
    half_edges,
    joined_shells,
    sorted_with_order,
    sum_by,
    used_only,
)
from .morton import morton_codes
from .progress import Report
from .scene import Float64

ATTEMPTS = 6
# Triangles from which a group is worth a run of its own, the least a run is asked to leave, and the share of a group
# that a run must remove to be worth it.
LARGE_GROUP = 1000
# Triangles of one run at most: some tenths of a second, in which nothing can be cancelled.
LARGEST_RUN = 100_000
LEAST_BUDGET = 8
WORTHWHILE = 0.7
# fast_simplification keeps the mesh in variables of its module.
_one_at_a_time = threading.Lock()


@dataclass(frozen=True)
class Reduced:
    """positions: (v, 3), moved but not renumbered. triangles: (n, 3) in old vertex numbers. source_triangle: (n,) the
    input triangle that each continues. vertex_map: (v,) the vertex each was merged into."""

    positions: Float64
    triangles: Int64
    source_triangle: Int64
    vertex_map: Int64


def reduce_groups(
    positions: Float64,
    triangles: Int64,
    group: Int64,
    weight: Float64,
    target: int,
    report: Report = lambda share: None,
) -> Reduced:
    """About `target` triangles, or more, shared among the groups, with the lines between groups in place.

    Half of them by weight, because light comes from there, and half by number of triangles, because a detailed shape
    needs some whatever its size.

    positions: (v, 3). triangles: (t, 3), an oriented manifold with border. group: (t,). weight: (t,) non-negative.
    report: called with the share of the work that is done before each part of a few tenths of a second, may raise.
    """
    group = _in_blocks(positions, triangles, group)
    apart, origin = _cut_between_groups(triangles, group, len(positions))
    points = positions[origin]
    kept = np.ones(len(triangles), bool)
    vertex_map = np.arange(len(points))
    done = 0
    for members, budget in _shares(group, weight, target):
        report(done / len(triangles))
        done += len(members)
        used, local = used_only(apart[members], len(points))
        part = reduce_roughly(points[used], local, budget)
        kept[members] = False
        kept[members[part.source_triangle]] = True
        points[used], vertex_map[used] = part.positions, used[part.vertex_map]
    moved = positions.copy()
    moved[origin] = points
    whole_map = np.arange(len(positions))
    whole_map[origin] = origin[vertex_map]
    source_triangle = np.flatnonzero(kept)
    return Reduced(moved, whole_map[triangles[source_triangle]], source_triangle, whole_map)


def _in_blocks(positions: Float64, triangles: Int64, group: Int64) -> Int64:
    """(t,) groups of which large ones are cut into blocks along the Z-order curve: no run takes long, and none sees the
    other's triangles, whose common lines stay for the fine part."""
    size = np.bincount(group)
    if size.max(initial=0) <= LARGEST_RUN:
        return group
    order = np.lexsort([morton_codes(middles(positions.take(triangles, axis=0))), group])
    place = np.arange(len(group)) - np.concatenate([[0], np.cumsum(size)])[group[order]]
    blocks = -(-size // LARGEST_RUN)
    block = place * blocks[group[order]] // np.maximum(size[group[order]], 1)
    number = np.empty(len(group), np.int64)
    number[order] = block + np.concatenate([[0], np.cumsum(blocks)])[group[order]]
    return number


def _cut_between_groups(triangles: Int64, group: Int64, vertex_count: int) -> tuple[Int64, Int64]:
    """Triangles whose vertices on lines between groups are doubled, and the vertex each one was.

    Both copies of a doubled vertex lie on a border and are never moved, so they can be put together again.
    """
    key = np.repeat(group, 3) * np.int64(vertex_count) + triangles.ravel()
    ascending, order = sorted_with_order(key, int(group.max(initial=0) + 1) * vertex_count)
    begins = np.concatenate([[True], ascending[1:] != ascending[:-1]])
    cut = np.empty(len(key), np.int64)
    cut[order] = np.cumsum(begins) - 1
    return cut.reshape(-1, 3), ascending[begins] % vertex_count


def _shares(group: Int64, weight: Float64, target: int) -> list[tuple[Int64, int]]:
    """(triangles, budget) of each run: large groups alone, small ones together, those with little to remove not."""
    size = np.bincount(group)
    power = sum_by(group, weight, len(size)) / max(float(weight.sum()), float(np.finfo(float).tiny))
    budget = target * 0.5 * (power + size / max(len(group), 1))
    reducible = (size > 0) & (budget < WORTHWHILE * size)
    large = reducible & (size >= LARGE_GROUP)
    _, order = sorted_with_order(group, len(size))
    ends = np.cumsum(size)
    runs = [(order[ends[g] - size[g] : ends[g]], max(int(budget[g]), LEAST_BUDGET)) for g in np.flatnonzero(large)]
    small = reducible & ~large
    if small.any():
        runs.append((np.flatnonzero(small[group]), max(int(budget[small].sum()), LEAST_BUDGET)))
    return runs


def reduce_roughly(positions: Float64, triangles: Int64, target: int) -> Reduced:
    """About `target` triangles, or more, with every border vertex in place, no edge opened and no shell lost.

    positions: (v, 3). triangles: (t, 3) use some of them. Triangles around faults are kept out of the next attempt;
    after ATTEMPTS faulty results the input is returned.
    """
    source = _Topology.of(triangles, len(positions))
    frozen = np.zeros(len(triangles), bool)
    for _ in range(ATTEMPTS):
        if frozen.sum() > 0.5 * target:
            # Faults all over: the library was asked for too much. With more left there are fewer.
            target, frozen = 4 * target, np.zeros(len(triangles), bool)
        loose = ~frozen
        budget = target - int(frozen.sum())
        if budget >= loose.sum():
            break
        reduced = _run(positions, triangles, loose, budget)
        fault = _faults(reduced, triangles, source)[reduced.vertex_map[triangles]].any(axis=1)
        lost = np.bincount(source.shell[reduced.source_triangle], minlength=int(source.shell.max()) + 1) == 0
        fault |= lost[source.shell]
        if not fault.any():
            return reduced
        frozen |= fault
    return Reduced(positions, triangles, np.arange(len(triangles)), np.arange(len(positions)))


@dataclass(frozen=True)
class _Topology:
    """Of the triangles before a reduction. shell: (t,) int64. border: (v,) bool, vertices on it."""

    shell: Int64
    border: Bool

    @staticmethod
    def of(triangles: Int64, vertex_count: int) -> _Topology:
        edges = half_edges(triangles, vertex_count)
        border = np.zeros(vertex_count, bool)
        border[triangles.ravel()[edges.twin < 0]] = True
        return _Topology(joined_shells(edges)[0], border)


def _run(positions: Float64, triangles: Int64, loose: Bool, budget: int) -> Reduced:
    used, local = used_only(triangles[loose], len(positions))
    points, collapses = _simplify(positions[used], local, budget)
    merged = np.arange(len(used))
    merged[collapses[:, 1]] = collapses[:, 0]
    while not np.array_equal(merged, merged[merged]):
        merged = merged[merged]
    vertex_map = np.arange(len(positions))
    vertex_map[used] = used[merged]
    mapped = vertex_map[triangles]
    a, b, c = mapped.T
    keep = np.flatnonzero((a != b) & (b != c) & (c != a))
    moved = positions.copy()
    # The library numbers the vertices of its result in the order of those that still have a triangle.
    left = used_only(merged[local][_distinct(merged[local])], len(used))[0]
    touched = np.zeros(len(used), bool)
    touched[collapses] = True
    touched = touched[left]
    moved[used[left[touched]]] = points[touched]
    return Reduced(moved, mapped[keep], keep, vertex_map)


def _distinct(triangles: Int64) -> Bool:
    a, b, c = triangles.T
    return (a != b) & (b != c) & (c != a)


def _simplify(points: Float64, triangles: Int64, budget: int) -> tuple[Float64, Int64]:
    import fast_simplification

    # Its error threshold grows from 2e-6 in units of length squared: with the mean edge at one, from small errors on.
    corners = points.take(triangles, axis=0)
    edges = corners - np.roll(corners, -1, axis=1)
    scale = max(float(np.linalg.norm(edges, axis=2).mean()), float(np.finfo(float).tiny))
    centre = points.mean(axis=0)
    with _one_at_a_time:
        result, _, collapses = fast_simplification.simplify(
            (points - centre) / scale,
            triangles.astype(np.int32),
            target_count=budget,
            return_collapses=True,
            preserve_border=True,
        )
    return result * scale + centre, np.asarray(collapses, np.int64).reshape(-1, 2)


def _faults(reduced: Reduced, triangles: Int64, source: _Topology) -> Bool:
    """(v,): vertices where the result has another topology than a manifold with the old border, or is not finite."""
    count = len(source.border)
    fault: Bool = ~np.isfinite(reduced.positions).all(axis=1)
    after = half_edges(reduced.triangles, count)
    start, end = reduced.triangles.ravel(), np.roll(reduced.triangles, -1, axis=1).ravel()
    opened = (after.twin < 0) & ~(source.border[start] & source.border[end])
    opened |= after.face_count[after.edge] > 2
    fault[start[opened]] = fault[end[opened]] = True
    fans = np.bincount(fans_apart(reduced.triangles, after)[1], minlength=count)
    several = fans > 1
    if several.any():
        # Triangles around a vertex are all that its fans depend on.
        around = several[triangles].any(axis=1)
        before = np.bincount(cut_to_manifold(triangles[around], count)[1], minlength=count)
        fault |= several & (fans > before)
    return fault
