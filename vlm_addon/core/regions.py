# SPDX-License-Identifier: GPL-3.0-or-later
"""Which source triangles each virtual light stands for.

A triangle that survives the collapses stands for itself. Any other goes to the nearest light, in place and in
direction, among those around the vertices that its own were merged into, and stays within its material group if it
can. Triangles of a shell that was dropped are adopted by a light nearby, so that their power is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh_topology import Bool, Int64, Rows, rows_by_key, sum_by, vertex_faces
from .reduce_surface import ReducedSurface
from .scene import Float64
from .source_surface import SourceSurface
from .triangle_tree import morton_codes

# Lights before and after a dropped shell on the Z-order curve among which its triangles choose.
ADOPTION_WINDOW = 16
PAIRS_PER_BATCH = 1 << 20


@dataclass(frozen=True)
class Regions:
    """light: (t,) int64, the light of each source triangle. adopted: (t,) bool, where its shell was dropped."""

    light: Int64
    adopted: Bool


def assign_regions(surface: SourceSurface, reduced: ReducedSurface) -> Regions:
    """The region of each light; none is empty."""
    positions, triangles, source_triangle = reduced.positions, reduced.triangles, reduced.source_triangle
    light_of = np.full(len(surface.triangles), -1, np.int64)
    light_of[source_triangle] = np.arange(len(triangles))
    merged = reduced.vertex_map[surface.triangles]
    adopted = (merged < 0).any(axis=1)
    around = vertex_faces(triangles, len(positions))
    lights = _Lights(positions[triangles], surface.group[source_triangle])
    open_rows = np.flatnonzero((light_of < 0) & ~adopted)
    for rows in np.array_split(open_rows, max(1, 18 * len(open_rows) // PAIRS_PER_BATCH)):
        light_of[rows] = _nearest_around(surface, lights, rows, merged[rows], around)
    if adopted.any():
        light_of[adopted] = _adopt(surface, lights, source_triangle, np.flatnonzero(adopted))
    return Regions(light_of, adopted)


class _Lights:
    def __init__(self, corners: Float64, group: Int64) -> None:
        self.corners = corners
        self.group = group
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(normals, axis=1)
        self.areas = 0.5 * doubled
        self.normals = normals / np.where(doubled > 0, doubled, 1.0)[:, None]


def _nearest_around(surface: SourceSurface, lights: _Lights, rows: Int64, merged: Int64, around: Rows) -> Int64:
    pairs = [around.expand(merged[:, corner]) for corner in range(3)]
    owner, light = (np.concatenate(part) for part in zip(*pairs, strict=True))
    centre = surface.corners[rows].mean(axis=1)
    score = squared_distances(centre[owner], lights.corners[light])
    cosine = np.einsum("ij,ij->i", surface.normals[rows][owner], lights.normals[light])
    score += (1.0 - cosine) * lights.areas[light]
    score += np.where(surface.group[rows][owner] == lights.group[light], 0.0, np.inf)
    return _least(score, owner, light, len(rows))


def _least(score: Float64, owner: Int64, choice: Int64, count: int) -> Int64:
    """The choice of least score of each owner; of the first where all scores are infinite."""
    order = np.lexsort([score, owner])
    first = np.searchsorted(owner[order], np.arange(count))
    return choice[order[first]]


def _adopt(surface: SourceSurface, lights: _Lights, source_triangle: Int64, rows: Int64) -> Int64:
    """A light near each row's shell: of the same motion and tag if there is one near, and rather facing alike."""
    centre = surface.corners[rows].mean(axis=1)
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
    for part in np.array_split(np.arange(len(rows)), max(1, near.size // PAIRS_PER_BATCH)):
        light = near[part]
        owner = np.repeat(np.arange(len(part)), light.shape[1])
        flat = light.ravel()
        score = squared_distances(centre[part][owner], lights.corners[flat])
        cosine = np.einsum("ij,ij->i", surface.normals[rows[part]][owner], lights.normals[flat])
        score = score * (2.0 - cosine) + surface.diagonal**2 * (
            (surface.dynamic[rows[part]][owner] != surface.dynamic[source_triangle[flat]]).astype(float)
            + (surface.tag[rows[part]][owner] != surface.tag[source_triangle[flat]])
        )
        chosen[part] = _least(score, owner, flat, len(part))
    return chosen


def squared_distances(points: Float64, corners: Float64) -> Float64:
    """(n,) squared distance from each point (n, 3) to its triangle (n, 3, 3)."""
    best = np.full(len(points), np.inf)
    inside = np.ones(len(points), bool)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for corner in range(3):
        start = corners[:, corner]
        side = corners[:, (corner + 1) % 3] - start
        offset = points - start
        length2 = np.einsum("ij,ij->i", side, side)
        along = np.einsum("ij,ij->i", offset, side) / np.where(length2 > 0, length2, 1.0)
        rest = offset - np.clip(along, 0.0, 1.0)[:, None] * side
        best = np.minimum(best, np.einsum("ij,ij->i", rest, rest))
        inside &= np.einsum("ij,ij->i", np.cross(side, offset), normal) >= 0
    square = np.einsum("ij,ij->i", normal, normal)
    height = np.einsum("ij,ij->i", points - corners[:, 0], normal)
    plane = height**2 / np.where(square > 0, square, 1.0)
    return np.where(inside & (square > 0), plane, best)
