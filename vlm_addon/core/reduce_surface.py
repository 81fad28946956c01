# SPDX-License-Identifier: GPL-3.0-or-later
"""The source surface with at most so many triangles: which shells get any, then the rough and the fine reduction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bulk_reduction import Reduced, reduce_groups
from .edge_collapse import CollapsedMesh, collapse_edges
from .mesh_topology import Bool, Int64, normals_and_areas, used_only
from .progress import Report
from .scene import Float64
from .source_surface import SourceSurface

# Triangles left by the rough reduction for each light asked for: more make the result no better; fewer than some
# thousands in all make coarse light meshes worse.
ROUGH_FACTOR = 8
ROUGH_LEAST = 4000
# The factor falls to this where it would leave more than so many triangles, which take long and gain little.
ROUGH_FACTOR_OF_MANY, ROUGH_MANY = 2.5, 40_000
WORTHWHILE = 1.3
# Share of the time that the rough reduction takes.
ROUGH_TIME = 0.7
# Detail from which triangles are reduced apart from the others.
DETAILED = 1.5
# Share of the budget that the least forms of all shells may take before the weakest shells are left out: to show small
# things as tetrahedra costs the large things more than to give their power to neighbours.
SHELL_SHARE = 0.25
LEAST_CLOSED, LEAST_OPEN = 4, 1
# Triangles below this share of the squared diagonal have no direction to shine in.
LEAST_AREA = 1e-18


@dataclass(frozen=True)
class ReducedSurface:
    """positions: (v, 3) float64, m. triangles: (n, 3) int64. source_triangle: (n,) the triangle of the surface that
    each continues. vertex_map: (vertices of the surface,) the vertex each was merged into, -1 where its shell was
    left out. merged_borders: whether the budget was too small to keep all borders between groups."""

    positions: Float64
    triangles: Int64
    source_triangle: Int64
    vertex_map: Int64
    merged_borders: bool


def reduce_surface(surface: SourceSurface, target: int, report: Report = lambda share: None) -> ReducedSurface:
    """At most `target` triangles; all with area where the surface has no more than that.

    report: called with the share of the work that is done, may raise.
    """
    solid = surface.areas > LEAST_AREA * surface.diagonal**2
    if int(solid.sum()) <= target:
        return _selected(surface, solid)
    report(0.0)
    rows = np.flatnonzero(_strongest_shells(surface, solid, target))
    weight = surface.weight() / np.where(surface.areas > 0, surface.areas, 1.0)
    begun = 0.0
    start = Reduced(surface.positions, surface.triangles[rows], np.arange(len(rows)), np.arange(len(surface.positions)))
    rough_target = int(min(ROUGH_FACTOR * target, max(ROUGH_FACTOR_OF_MANY * target, ROUGH_MANY)))
    if len(rows) > WORTHWHILE * max(rough_target, ROUGH_LEAST):
        power = (weight * surface.areas)[rows]
        start = reduce_groups(
            surface.positions,
            surface.triangles[rows],
            _alike(surface)[rows],
            power,
            max(rough_target, ROUGH_LEAST),
            lambda share: report(ROUGH_TIME * share),
        )
        begun = ROUGH_TIME
    left = rows[start.source_triangle]
    used, triangles = used_only(start.triangles, len(surface.positions))
    centre, size = surface.positions[used].mean(axis=0), surface.diagonal
    positions = (start.positions[used] - centre) / size
    power = weight[left] * _areas(positions, triangles)
    collapsed = collapse_edges(
        positions,
        triangles,
        surface.group[left],
        power,
        target,
        surface.normals[left],
        lambda share: report(begun + (1.0 - begun) * share),
    )
    collapsed = _within_budget(collapsed, surface, left, target)
    number = np.full(len(surface.positions), -1, np.int64)
    number[used] = np.arange(len(used))
    taken_part = np.zeros(len(surface.positions), bool)
    taken_part[surface.triangles[rows]] = True
    merged = np.where(taken_part, number[start.vertex_map], -1)
    return ReducedSurface(
        positions=collapsed.positions * size + centre,
        triangles=collapsed.triangles,
        source_triangle=left[collapsed.source_triangle],
        vertex_map=np.where(merged >= 0, collapsed.vertex_map[merged], -1),
        merged_borders=collapsed.merged_borders,
    )


def _alike(surface: SourceSurface) -> Int64:
    """(t,): groups, parted where more detail is asked for, so that the rough reduction spares it."""
    return 2 * surface.group + (surface.detail > DETAILED)


def _selected(surface: SourceSurface, chosen: Bool) -> ReducedSurface:
    rows = np.flatnonzero(chosen)
    used, triangles = used_only(surface.triangles[rows], len(surface.positions))
    number = np.full(len(surface.positions), -1, np.int64)
    number[used] = np.arange(len(used))
    return ReducedSurface(surface.positions[used], triangles, rows, number, False)


def _strongest_shells(surface: SourceSurface, solid: Bool, target: int) -> Bool:
    """(t,): triangles of the strongest shells, as many as the budget has room for."""
    count = len(surface.closed)
    power = np.bincount(surface.shell, weights=surface.weight(), minlength=count)
    size = np.bincount(surface.shell[solid], minlength=count)
    least = np.minimum(size, np.where(surface.closed, LEAST_CLOSED, LEAST_OPEN))
    order = np.argsort(np.where(size > 0, -power, np.inf), kind="stable")
    fits = np.cumsum(least[order]) <= SHELL_SHARE * target
    # More where those would not even have as many triangles as there may be lights.
    fits |= np.cumsum(size[order]) - size[order] < target
    kept = np.zeros(count, bool)
    kept[order[fits]] = True
    return (kept & (size > 0))[surface.shell]


def _within_budget(collapsed: CollapsedMesh, surface: SourceSurface, left: Int64, target: int) -> CollapsedMesh:
    """Without triangles that have no area and, where still more than `target` are left, without the weakest shells.

    If even one shell has more than `target`, its largest triangles are kept, which opens it.
    """
    shell = surface.shell[left[collapsed.source_triangle]]
    solid = _areas(collapsed.positions, collapsed.triangles) > LEAST_AREA
    power = np.bincount(surface.shell, weights=surface.weight())
    size = np.bincount(shell[solid], minlength=len(power))
    order = np.argsort(-power, kind="stable")
    kept = np.zeros(len(power), bool)
    kept[order[np.cumsum(size[order]) <= max(target, size[order[0]])]] = True
    keep = solid & kept[shell]
    if keep.sum() > target:
        area = np.where(keep, _areas(collapsed.positions, collapsed.triangles), -1.0)
        keep = np.zeros(len(keep), bool)
        keep[np.argsort(-area, kind="stable")[:target]] = True
    if keep.all():
        return collapsed
    used, triangles = used_only(collapsed.triangles[keep], len(collapsed.positions))
    number = np.full(len(collapsed.positions), -1, np.int64)
    number[used] = np.arange(len(used))
    return CollapsedMesh(
        positions=collapsed.positions[used],
        triangles=triangles,
        source_triangle=collapsed.source_triangle[keep],
        vertex_map=np.where(collapsed.vertex_map >= 0, number[collapsed.vertex_map], -1),
        merged_borders=collapsed.merged_borders,
    )


def _areas(positions: Float64, triangles: Int64) -> Float64:
    return normals_and_areas(positions.take(triangles, axis=0))[1]
