# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of baked visibility: the surface of a zone that faces one of six ways, and points of it to look from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .morton import morton_codes
from .octree_march import reaches
from .sampling import square_to_triangle, unit_square_points
from .scene import Float64, Int32, SceneSnapshot
from .visibility_cells import Bools, Int64, VisibilityCells
from .voxel_frame import VoxelFrame

IsOpen = Callable[[Float64, Float64], Bools]
"""Of (n, 3) surface points in voxel coordinates and their unit normals, (n,) whether no surface is between each and its
lifted place."""
WAYS = 6
"""2 axis + 1 for the negative one: which way a surface faces most."""
# Samples from which a row's points are chosen, for each square voxel of surface.
_SAMPLES_PER_AREA = 1.0


@dataclass(frozen=True)
class VisibilityRows:
    """zones, ways: (r,) int32. places: (r, p, 3) in voxel coordinates, of the surface itself. normals: (r, p, 3) unit,
    geometric, on the zone's side."""

    zones: Int32
    ways: Int32
    places: Float64
    normals: Float64

    def __len__(self) -> int:
        return len(self.zones)


def make_rows(
    snapshot: SceneSnapshot, frame: VoxelFrame, cells: VisibilityCells, points_per_row: int, is_open: IsOpen
) -> VisibilityRows:
    """A row for each zone and way in which samples of the visible surface lie, both sides of it; the same on every run.

    The points of a row are spread evenly over the area of its samples. Samples whose zone is not known, because
    something else fills the voxel over them, or is not reached from them belong to none.
    """
    places, normals, areas = _samples(opaque_corners(snapshot, frame))
    places, normals = np.concatenate([places, places]), np.concatenate([normals, -normals])
    areas = np.concatenate([areas, areas])
    zones = cells.zones_at(lifted_places(places, normals))
    known = np.flatnonzero(zones >= 0)
    known = known[is_open(places[known], normals[known])]
    keys = zones[known] * WAYS + ways_of(normals[known])
    order = np.lexsort([morton_codes(places[known]), keys])
    known, keys = known[order], keys[order]
    starts = np.flatnonzero(np.diff(keys, prepend=-1))
    chosen = known[_spread(areas[known], starts, points_per_row)]
    return VisibilityRows(
        zones=(keys[starts] // WAYS).astype(np.int32),
        ways=(keys[starts] % WAYS).astype(np.int32),
        places=places[chosen],
        normals=normals[chosen],
    )


def lifted_places(places: Float64, normals: Float64) -> Float64:
    """(n, 3) places whose own voxel their surface does not touch: a surface point's cell and zone are those of this."""
    return np.asarray(places + normals * reaches(normals)[:, None])


def ways_of(normals: Float64) -> Int64:
    """(n,) which of WAYS each normal faces most."""
    axis = np.abs(normals).argmax(axis=1)
    return np.asarray(2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] < 0.0), np.int64)


def opaque_corners(snapshot: SceneSnapshot, frame: VoxelFrame) -> Float64:
    """(t, 3, 3) corners of the triangles that show, in voxel coordinates."""
    shown = np.array([material.alpha > 0.0 for material in snapshot.materials])
    parts = [np.zeros((0, 3, 3))]
    for mesh in snapshot.meshes:
        triangles = mesh.triangles[shown[mesh.material_indices]] if len(shown) else mesh.triangles
        parts.append(frame.voxels(mesh.positions)[triangles])
    return np.concatenate(parts)


def _samples(corners: Float64) -> tuple[Float64, Float64, Float64]:
    """Places (n, 3), unit normals (n, 3) and areas (n,): even over each triangle, at least one of each."""
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_areas = np.linalg.norm(crossed, axis=1)
    usable = np.flatnonzero(double_areas > 0.0)
    counts = np.ceil(0.5 * double_areas[usable] * _SAMPLES_PER_AREA).astype(np.int64)
    owner = np.repeat(np.arange(len(usable)), counts)
    index = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    x, y = unit_square_points(index, counts[owner], owner)
    triangle = usable[owner]
    places = np.einsum("nk,nkj->nj", square_to_triangle(x, y), corners[triangle])
    normals = crossed[triangle] / double_areas[triangle, None]
    return places, normals, 0.5 * double_areas[triangle] / counts[owner]


def _spread(areas: Float64, starts: Int64 | Sequence[int], count: int) -> Int64:
    """(rows, count) samples at even steps through the area of each row; samples of a row follow each other."""
    total = np.concatenate([[0.0], np.cumsum(areas)])
    starts = np.asarray(starts, np.int64)
    ends = np.append(starts[1:], len(areas)).astype(np.int64)
    steps = (np.arange(count) + 0.5) / count
    at = total[starts][:, None] + steps * (total[ends] - total[starts])[:, None]
    chosen = np.searchsorted(total, at.ravel(), side="right").reshape(at.shape) - 1
    return np.asarray(np.clip(chosen, starts[:, None], ends[:, None] - 1), np.int64)
