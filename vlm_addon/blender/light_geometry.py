# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the lights of a light mesh object are in the world, face by face, in object mode and in edit mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.mesh_topology import Bool, Rows, rows_by_key
from ..core.scene import Float64, Int32
from .extraction.mesh_arrays import flipped, read


@dataclass(frozen=True)
class LightFaces:
    """Faces of one light mesh as triangles in world space.

    corners: (t, 3, 3) float64 m, counter-clockwise as seen from the side that shines. faces: (t,) int32, the face of
    each triangle. count: faces, those without area included.
    """

    corners: Float64
    faces: Int32
    count: int

    @property
    def triangle_areas(self) -> Float64:
        """(t,) m²."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    @property
    def areas(self) -> Float64:
        """(count,) m²: area of each face."""
        return np.bincount(self.faces, weights=self.triangle_areas, minlength=self.count).astype(np.float64)

    @property
    def middles(self) -> Float64:
        """(count, 3) m: mean of the corners of each face's triangles, weighted by area."""
        weights = self.triangle_areas + np.finfo(np.float64).tiny
        total = np.bincount(self.faces, weights=weights, minlength=self.count)
        centroids = self.corners.mean(axis=1)
        sums = [np.bincount(self.faces, weights=weights * axis, minlength=self.count) for axis in centroids.T]
        return np.stack(sums, axis=1) / np.where(total > 0.0, total, 1.0)[:, None]

    @property
    def triangles_of(self) -> Rows:
        """The triangles of each face."""
        return rows_by_key(self.faces.astype(np.int64), self.count)

    def subset(self, chosen: Bool) -> LightFaces:
        """The faces of `chosen`, (count,) bool, numbered anew in order."""
        kept = chosen[self.faces]
        numbers = np.cumsum(chosen) - 1
        return LightFaces(self.corners[kept], numbers[self.faces[kept]].astype(np.int32), int(chosen.sum()))


def light_faces_in_world(thing: Any, depsgraph: Any = None) -> LightFaces:
    """The faces of a light mesh object as it is edited, in the order of light_faces.py.

    depsgraph: where given, vertices are where its modifiers and shape keys move them, as long as these add none and
    the object is not being edited.
    """
    if thing.mode == "EDIT":
        thing.update_from_editmode()
    mesh = thing.data
    mesh.calc_loop_triangles()
    triangles = read(mesh.loop_triangles, "vertices", np.int32, 3).reshape(-1, 3)
    faces = read(mesh.loop_triangles, "polygon_index", np.int32)
    positions, matrix = _positions(thing, depsgraph)
    world = positions @ matrix[:3, :3].T + matrix[:3, 3]
    corners = world[triangles]
    mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
    return LightFaces(flipped(corners) if mirrored else corners, faces, len(mesh.polygons))


def _positions(thing: Any, depsgraph: Any) -> tuple[Float64, Float64]:
    """(v, 3) local positions and the (4, 4) world matrix."""
    if depsgraph is None or thing.mode == "EDIT":
        return _coordinates(thing.data), np.array(thing.matrix_world, np.float64)
    evaluated = thing.evaluated_get(depsgraph)
    matrix = np.array(evaluated.matrix_world, np.float64)
    mesh = evaluated.to_mesh()
    try:
        moved = _coordinates(mesh)
    finally:
        evaluated.to_mesh_clear()
    stored = _coordinates(thing.data)
    return (moved if len(moved) == len(stored) else stored), matrix


def _coordinates(mesh: Any) -> Float64:
    return read(mesh.vertices, "co", np.float32, 3).reshape(-1, 3).astype(np.float64)
