# SPDX-License-Identifier: GPL-3.0-or-later
"""Which source triangles each virtual light stands for.

A triangle that survives the collapses stands for itself unless it was turned over. Any other goes to the nearest
light, in place and in direction, among those around the vertices that its own were merged into, and stays within its
material group and on the side it faces if it can. Triangles of a shell that was dropped are adopted by a light
nearby, so that their power is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .corner_arrays import middles
from .mesh_topology import Bool, Int64, Rows, normals_and_areas, rows_by_key, sum_by, vertex_faces
from .morton import morton_codes
from .parallel import side_by_side, slices
from .progress import Report
from .reduce_surface import ReducedSurface
from .scene import Float64
from .source_surface import SourceSurface

# Lights before and after a dropped shell on the Z-order curve among which its triangles choose.
ADOPTION_WINDOW = 8
# A light that would shine on what it stands for counts as so many times as far, squared.
SHONE_ON = 16.0
# Some ten candidates each, which fit into a cache.
ROWS_PER_BATCH = 1 << 13


@dataclass(frozen=True)
class Regions:
    """light: (t,) int64, the light of each source triangle. adopted: (t,) bool, where its shell was dropped."""

    light: Int64
    adopted: Bool


def assign_regions(surface: SourceSurface, reduced: ReducedSurface, report: Report = lambda share: None) -> Regions:
    """The region of each light; only one that faces away from everything near it is left without.

    report: called with the share of the work that is done, may raise.
    """
    positions, triangles, source_triangle = reduced.positions, reduced.triangles, reduced.source_triangle
    light_of = np.full(len(surface.triangles), -1, np.int64)
    lights = _Lights(positions[triangles], surface.group[source_triangle])
    alike = np.einsum("ij,ij->i", surface.normals[source_triangle], lights.normals) > 0
    light_of[source_triangle[alike]] = np.flatnonzero(alike)
    merged = reduced.vertex_map.take(surface.triangles)
    adopted = (merged[:, 0] < 0) | (merged[:, 1] < 0) | (merged[:, 2] < 0)
    around = vertex_faces(triangles, len(positions))
    open_rows = np.flatnonzero((light_of < 0) & ~adopted)
    batches = [open_rows[part] for part in slices(len(open_rows), ROWS_PER_BATCH)]

    def nearest(rows: Int64) -> Int64:
        return _nearest_around(surface, lights, rows, merged.take(rows, axis=0), around)

    for rows, found in zip(batches, side_by_side(nearest, batches, report), strict=True):
        light_of[rows] = found
    if adopted.any():
        light_of[adopted] = _adopt(surface, lights, source_triangle, np.flatnonzero(adopted))
    return Regions(light_of, adopted)


class _Lights:
    """Corners, groups, areas and normals of the lights, and each light in a frame of its own in which it is flat."""

    def __init__(self, corners: Float64, group: Int64) -> None:
        self.corners = corners
        self.group = group
        side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        self.normals, self.areas = normals_and_areas(corners)
        length = np.linalg.norm(side, axis=1)
        x_axis = side / np.where(length > 0, length, 1.0)[:, None]
        y_axis = np.cross(self.normals, x_axis)
        self.frames = np.stack([x_axis, y_axis, self.normals], axis=1)
        zero = np.zeros(len(corners))
        flat_x = np.stack([zero, length, np.einsum("ij,ij->i", other, x_axis)], axis=1)
        flat_y = np.stack([zero, zero, np.einsum("ij,ij->i", other, y_axis)], axis=1)
        flat = np.stack([flat_x, flat_y], axis=2)
        sides = np.roll(flat, -1, axis=1) - flat
        square = np.einsum("nck,nck->nc", sides, sides)
        # One row for each quantity, which are gathered one by one: several times as fast as rows of a light.
        self._origin, self._frame = corners[:, 0].T.copy(), self.frames.transpose(1, 2, 0).copy()
        self._start, self._side = flat.transpose(1, 2, 0).copy(), sides.transpose(1, 2, 0).copy()
        self._normal = self.normals.T.copy()
        self._square = np.where(square > 0, square, 1.0).T.copy()

    def cosines(self, normals: Float64, owner: Int64, light: Int64) -> Float64:
        """(n,) cosine between row `owner` of unit normals (m, 3) and that of the light beside it."""
        x, y, z = (
            np.ascontiguousarray(normals[:, axis]).take(owner) * self._normal[axis].take(light) for axis in range(3)
        )
        cosine: Float64 = x + y + z
        return cosine

    def squared_distances(self, points: Float64, light: Int64) -> Float64:
        """(n,) squared distance from each point (n, 3) to the light beside it, m²."""
        offset = [points[:, axis] - self._origin[axis].take(light) for axis in range(3)]
        x, y, height = (sum(row[axis].take(light) * offset[axis] for axis in range(3)) for row in self._frame)
        best = np.full(len(points), np.inf)
        inside = np.ones(len(points), bool)
        for start, side, square in zip(self._start, self._side, self._square, strict=True):
            side_x, side_y = side[0].take(light), side[1].take(light)
            dx, dy = x - start[0].take(light), y - start[1].take(light)
            along = (dx * side_x + dy * side_y) / square.take(light)
            along = np.minimum(np.maximum(along, 0.0), 1.0)
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
    centre = middles(surface.positions.take(surface.triangles.take(rows, axis=0), axis=0))
    score = lights.squared_distances(centre.take(owner, axis=0), light)
    cosine = lights.cosines(surface.normals.take(rows, axis=0), owner, light)
    score += (1.0 - cosine) * lights.areas.take(light)
    # Rather a light of another direction than one of another group, and rather any than none.
    strange = surface.group.take(rows).take(owner) != lights.group.take(light)
    score += surface.diagonal**2 * ((cosine <= 0) + 2.0 * strange)
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
