# SPDX-License-Identifier: GPL-3.0-or-later
"""Which source triangles each virtual light stands for.

A triangle that survives the collapses stands for itself unless it was turned over. Any other goes to the nearest
light, in place and in direction, among those around the vertices that its own were merged into, and stays within its
material group and on the side it faces if it can. Triangles of a shell that was dropped are adopted by a light
nearby, so that their power is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .mesh_topology import Bool, Int64, Rows, rows_by_key, sum_by, vertex_faces
from .morton import morton_codes
from .reduce_surface import ReducedSurface
from .scene import Float64
from .source_surface import SourceSurface

# Lights before and after a dropped shell on the Z-order curve among which its triangles choose.
ADOPTION_WINDOW = 8
# A light that would shine on what it stands for counts as so many times as far, squared.
SHONE_ON = 16.0
# Some ten candidates each.
ROWS_PER_BATCH = 1 << 16


@dataclass(frozen=True)
class Regions:
    """light: (t,) int64, the light of each source triangle. adopted: (t,) bool, where its shell was dropped."""

    light: Int64
    adopted: Bool


def assign_regions(
    surface: SourceSurface, reduced: ReducedSurface, report: Callable[[float], None] = lambda share: None
) -> Regions:
    """The region of each light; only one that faces away from everything near it is left without.

    report: called with the share of the work that is done, may raise.
    """
    positions, triangles, source_triangle = reduced.positions, reduced.triangles, reduced.source_triangle
    light_of = np.full(len(surface.triangles), -1, np.int64)
    lights = _Lights(positions[triangles], surface.group[source_triangle])
    alike = np.einsum("ij,ij->i", surface.normals[source_triangle], lights.normals) > 0
    light_of[source_triangle[alike]] = np.flatnonzero(alike)
    merged = reduced.vertex_map[surface.triangles]
    adopted = (merged < 0).any(axis=1)
    around = vertex_faces(triangles, len(positions))
    open_rows = np.flatnonzero((light_of < 0) & ~adopted)
    for first in range(0, len(open_rows), ROWS_PER_BATCH):
        report(first / len(open_rows))
        rows = open_rows[first : first + ROWS_PER_BATCH]
        light_of[rows] = _nearest_around(surface, lights, rows, merged[rows], around)
    if adopted.any():
        light_of[adopted] = _adopt(surface, lights, source_triangle, np.flatnonzero(adopted))
    return Regions(light_of, adopted)


class _Lights:
    """Corners, groups, areas and normals of the lights, and each light in a frame of its own in which it is flat."""

    def __init__(self, corners: Float64, group: Int64) -> None:
        self.corners = corners
        self.group = group
        side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(side, other)
        doubled = np.linalg.norm(normal, axis=1)
        self.areas = 0.5 * doubled
        self.normals = normal / np.where(doubled > 0, doubled, 1.0)[:, None]
        length = np.linalg.norm(side, axis=1)
        x_axis = side / np.where(length > 0, length, 1.0)[:, None]
        y_axis = np.cross(self.normals, x_axis)
        self.frames = np.stack([x_axis, y_axis, self.normals], axis=1)
        zero = np.zeros(len(corners))
        flat_x = np.stack([zero, length, np.einsum("ij,ij->i", other, x_axis)], axis=1)
        flat_y = np.stack([zero, zero, np.einsum("ij,ij->i", other, y_axis)], axis=1)
        self.flat = np.stack([flat_x, flat_y], axis=2)

    def squared_distances(self, points: Float64, light: Int64) -> Float64:
        """(n,) squared distance from each point (n, 3) to the light beside it, m²."""
        offset = points - self.corners[light, 0]
        x, y, height = np.einsum("ikj,ij->ki", self.frames[light], offset)
        flat = self.flat[light]
        best = np.full(len(points), np.inf)
        inside = np.ones(len(points), bool)
        for corner in range(3):
            start_x, start_y = flat[:, corner].T
            side_x, side_y = (flat[:, (corner + 1) % 3] - flat[:, corner]).T
            dx, dy = x - start_x, y - start_y
            square = side_x * side_x + side_y * side_y
            along = np.clip((dx * side_x + dy * side_y) / np.where(square > 0, square, 1.0), 0.0, 1.0)
            rest_x, rest_y = dx - along * side_x, dy - along * side_y
            best = np.minimum(best, rest_x * rest_x + rest_y * rest_y)
            inside &= side_x * dy - side_y * dx >= 0
        return np.where(inside, 0.0, best) + height * height

    def shine_on(self, points: Float64, normals: Float64, light: Int64) -> Bool:
        """(n,) whether any of the light beside it reaches each point (n, 3) of a surface with that normal."""
        offset = self.corners[light] - points[:, None]
        in_front = np.einsum("ij,ij->i", self.normals[light], offset[:, 0]) < 0
        over_horizon: Bool = np.einsum("ikj,ij->ik", offset, normals).max(axis=1) > 0
        return in_front & over_horizon


def _nearest_around(surface: SourceSurface, lights: _Lights, rows: Int64, merged: Int64, around: Rows) -> Int64:
    again = merged[:, 1] == merged[:, 0], (merged[:, 2] == merged[:, 0]) | (merged[:, 2] == merged[:, 1])
    kept = np.arange(len(rows)), np.flatnonzero(~again[0]), np.flatnonzero(~again[1])
    pairs = [around.expand(merged[part, corner]) for corner, part in enumerate(kept)]
    owner = np.concatenate([part[pair[0]] for part, pair in zip(kept, pairs, strict=True)])
    light = np.concatenate([pair[1] for pair in pairs])
    centre = surface.positions[surface.triangles[rows]].mean(axis=1)
    score = lights.squared_distances(centre[owner], light)
    cosine = np.einsum("ij,ij->i", surface.normals[rows[owner]], lights.normals[light])
    score += (1.0 - cosine) * lights.areas[light]
    # Rather a light of another direction than one of another group, and rather any than none.
    score += surface.diagonal**2 * ((cosine <= 0) + 2.0 * (surface.group[rows[owner]] != lights.group[light]))
    return _least(score, owner, light, len(rows))


def _least(score: Float64, owner: Int64, choice: Int64, count: int) -> Int64:
    """The choice of least score of each owner."""
    # Owners come in a few ascending runs, which the stable sort merges in one go.
    order = np.argsort(owner, kind="stable")
    owner, score = owner[order], score[order]
    starts = np.searchsorted(owner, np.arange(count))
    best = np.flatnonzero(score == np.minimum.reduceat(score, starts)[owner])
    return choice[order[best[np.searchsorted(owner[best], np.arange(count))]]]


def _adopt(surface: SourceSurface, lights: _Lights, source_triangle: Int64, rows: Int64) -> Int64:
    """A light near each row's shell: of the same motion and tag if there is one near, and rather facing alike."""
    centre = surface.positions[surface.triangles[rows]].mean(axis=1)
    _, shell = np.unique(surface.shell[rows], return_inverse=True)
    members = rows_by_key(shell, int(shell.max()) + 1)
    middle = np.stack([sum_by(shell, centre[:, axis], len(members.lengths)) for axis in range(3)], axis=1)
    middle = middle / members.lengths[:, None]
    code = morton_codes(np.concatenate([lights.corners.mean(axis=1), middle]))
    order = np.argsort(code[: len(lights.corners)], kind="stable")
    place = np.searchsorted(code[: len(lights.corners)][order], code[len(lights.corners) :])
    window = np.arange(-ADOPTION_WINDOW, ADOPTION_WINDOW)
    near = order[np.clip(place[:, None] + window, 0, len(order) - 1)][shell]
    chosen = np.empty(len(rows), np.int64)
    for first in range(0, len(rows), ROWS_PER_BATCH):
        part = np.arange(first, min(first + ROWS_PER_BATCH, len(rows)))
        light = near[part]
        owner = np.repeat(np.arange(len(part)), light.shape[1])
        flat = light.ravel()
        score = lights.squared_distances(centre[part][owner], flat)
        cosine = np.einsum("ij,ij->i", surface.normals[rows[part]][owner], lights.normals[flat])
        shone_on = lights.shine_on(centre[part][owner], surface.normals[rows[part]][owner], flat)
        score *= (2.0 - cosine) * np.where(shone_on, SHONE_ON, 1.0)
        score += surface.diagonal**2 * (
            (surface.dynamic[rows[part]][owner] != surface.dynamic[source_triangle[flat]]).astype(float)
            + (surface.tag[rows[part]][owner] != surface.tag[source_triangle[flat]])
        )
        chosen[part] = _least(score, owner, flat, len(part))
    return chosen
