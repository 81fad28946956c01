# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that a stroke erases or cuts, found by where they are; the surface in front of them need not be known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bmesh
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...core.counting import counted, counted_verb
from ...core.errors import InvalidInput
from ...core.scene import Float64
from ..light_faces import read_faces
from ..light_meshes import chosen_light_meshes, require_editable
from ..names import LOCK_ATTRIBUTE
from .draw_lights import light_count
from .draw_mesh import edited, rings_of, vertices_world
from .draw_surfaces import FACING_COSINE
from .drawn_faces import plane_of

ON_PLANE_SHARE = 1e-6
"""Vertices within this share of a face's size of the cut count as on it."""


@dataclass(frozen=True)
class LightTree:
    """The lights of a light mesh, to be found by where they are. The tree is in float32, around `middle`."""

    vertices: Float64
    rings: list[list[int]]
    tree: Any
    middle: Float64
    turned: float

    @classmethod
    def of(cls, thing: Any) -> LightTree:
        """The lights as they are being edited."""
        vertices, rings = vertices_world(thing), rings_of(thing)
        middle = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
        tree = BVHTree.FromPolygons((vertices - middle).tolist(), rings) if rings else None
        return cls(vertices, rings, tree, middle, -1.0 if np.linalg.det(np.array(thing.matrix_world)) < 0.0 else 1.0)

    def near(self, point: Float64, normal: Float64, radius: float) -> set[int]:
        """Rows of the lights within `radius` (m) of a point, or straight under it, that face as the surface does.

        normal: of the surface, zero for either side.
        """
        if self.tree is None:
            return set()
        local = Vector(point - self.middle)
        found = {row for _, front, row, _ in self.tree.find_nearest_range(local, radius) if self._faces(front, normal)}
        # Under a hollow surface a light may lie deeper than the radius.
        if normal.any():
            place, front, row, distance = self.tree.ray_cast(local, Vector(-normal))
            if place is not None and distance < _extent(self.outline(row)) and self._faces(front, normal):
                found.add(row)
        return found

    def outline(self, row: int) -> Float64:
        """(k + 1, 3) world corners of a light, closed."""
        ring = self.rings[row]
        return self.vertices[[*ring, ring[0]]]

    def _faces(self, front: Any, normal: Float64) -> bool:
        return not normal.any() or self.turned * float(np.dot(front, normal)) > FACING_COSINE


def erase(context: Any, points: Float64, normals: Float64, radius: float) -> str:
    """Delete the unlocked lights under a stroke from the chosen light meshes; returns a sentence with counts.

    Raises InvalidInput; nothing is changed then.
    """
    if not len(points):
        raise InvalidInput("stroke", "it has no points", "give points on the surface")
    require_all_editable(context)
    erased = kept = left = 0
    for thing in chosen_light_meshes(context):
        tree, locked = LightTree.of(thing), _locked(thing)
        found = {row for point, normal in zip(points, normals, strict=True) for row in tree.near(point, normal, radius)}
        rows = found - locked
        erased, kept, left = erased + len(rows), kept + len(found & locked), left + len(tree.rings) - len(rows)
        if rows:
            with edited(thing) as mesh:
                bmesh.ops.delete(mesh, geom=[face for face in mesh.faces if face.index in rows], context="FACES")
    if not erased and kept:
        problem = counted_verb(kept, "light", "under it is locked", "under it are locked")
        raise InvalidInput("stroke", problem, "unlock first")
    if not erased:
        raise InvalidInput("stroke", "no light is under it", "select the light mesh, or use a larger radius")
    locked_ones = f"; {kept} locked kept" if kept else ""
    return f"Erased {light_count(erased)}{locked_ones}" + ("" if left else "; none is left")


def cut(context: Any, points: Float64, normals: Float64) -> str:
    """Cut the unlocked lights along the way through `points`; each part keeps colour, tag and all else.

    points: (n, 3) world, n at least 2; normals: (n, 3), of the surface: the cut goes straight into it. A light that
    the way ends in is cut through. Returns a sentence with counts. Raises InvalidInput; nothing is changed then.
    """
    if len(points) < 2:
        problem = counted_verb(len(points), "point", "is no way across", "are no way across")
        raise InvalidInput("cut", problem, "give at least two")
    ways = list(zip(points[:-1], points[1:], _means(normals), strict=True))
    require_all_editable(context)
    before = after = 0
    for thing in chosen_light_meshes(context):
        locked = _locked(thing)
        with edited(thing) as mesh:
            before += len(mesh.faces)
            free = [face for face in mesh.faces if face.index not in locked]
            for way in ways:
                free = _cut_along(mesh, free, np.array(thing.matrix_world, np.float64), *way)
            after += len(mesh.faces)
    if after == before:
        raise InvalidInput("cut", "no unlocked light lies under it", "select the light mesh and cut across its lights")
    return f"Cut {counted(after - before, 'time')}: {counted(after, 'light')}"


def require_all_editable(context: Any) -> None:
    """Raises InvalidInput where one of the chosen light meshes cannot be changed."""
    for thing in chosen_light_meshes(context):
        require_editable(thing)


def _cut_along(
    mesh: Any, faces: list[Any], matrix: Float64, start: Float64, end: Float64, normal: Float64
) -> list[Any]:
    """Bisect those of `faces` that lie under the way from `start` to `end` (world); returns all faces, old and new."""
    result = []
    for face in faces:
        across = _cut_plane(face, matrix, start, end, normal)
        if across is None:
            result.append(face)
            continue
        inverse = np.linalg.inv(matrix)
        made = bmesh.ops.bisect_plane(
            mesh,
            geom=[face, *face.edges, *face.verts],
            dist=ON_PLANE_SHARE * face.calc_perimeter(),
            plane_co=Vector(inverse[:3, :3] @ start + inverse[:3, 3]),
            plane_no=Vector(matrix[:3, :3].T @ across).normalized(),
        )
        result += [each for each in made["geom"] if isinstance(each, bmesh.types.BMFace)]
    mesh.faces.index_update()
    return result


def _cut_plane(face: Any, matrix: Float64, start: Float64, end: Float64, normal: Float64) -> Float64 | None:
    """(3,) the normal in world space of the plane that cuts the face, None where the way does not lead over it."""
    ring = np.array([tuple(vertex.co) for vertex in face.verts], np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    facing, area = plane_of(ring)
    facing = -facing if np.linalg.det(matrix[:3, :3]) < 0.0 else facing
    upward = normal if normal.any() else facing
    across = np.cross(end - start, upward)
    length = float(np.linalg.norm(across))
    if facing @ upward <= FACING_COSINE or length == 0.0:
        return None
    across = across / length
    sides = (ring - start) @ across
    least = ON_PLANE_SHARE * _extent(ring)
    if not (sides.max() > least and sides.min() < -least):
        return None
    others, there = np.roll(ring, -1, axis=0), np.roll(sides, -1)
    crossed = (sides > 0.0) != (there > 0.0)
    share = (sides[crossed] / (sides[crossed] - there[crossed]))[:, None]
    places = ring[crossed] + share * (others[crossed] - ring[crossed]) - start
    way = end - start
    along = places @ way / float(way @ way)
    height = float(np.abs(places @ upward).min())
    return across if along.max() > 0.0 and along.min() < 1.0 and height < np.sqrt(area) else None


def _extent(points: Float64) -> float:
    return float(np.ptp(points, axis=0).max())


def _locked(thing: Any) -> set[int]:
    return set(np.flatnonzero(read_faces(thing, LOCK_ATTRIBUTE)).tolist())


def _means(normals: Float64) -> Float64:
    sums = normals[:-1] + normals[1:]
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    means: Float64 = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0)
    return means
