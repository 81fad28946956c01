# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that a stroke erases or cuts, found by where they are; the surface in front of them need not be known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bmesh
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ..core.errors import InvalidInput
from ..core.scene import Float64
from .draw_mesh import edited, rings_of, vertices_world
from .draw_surfaces import FACING_COSINE
from .drawn_faces import plane_of
from .light_faces import read_faces
from .light_meshes import chosen_light_meshes, require_editable
from .names import LOCK_ATTRIBUTE

ON_PLANE_SHARE = 1e-6
"""Vertices within this share of a face's size of the cut count as on it."""


def lights_near(thing: Any, points: Float64, normals: Float64, radius: float) -> set[int]:
    """Rows of the lights within `radius` (m) of any of the points that face as the surface does there.

    points: (n, 3) world; normals: (n, 3), zero for either side.
    """
    rings = rings_of(thing)
    if not rings:
        return set()
    middle = points.mean(axis=0)
    vertices = vertices_world(thing) - middle
    tree = BVHTree.FromPolygons(vertices.tolist(), rings)
    turned = -1.0 if np.linalg.det(np.array(thing.matrix_world)) < 0.0 else 1.0

    def faces_alike(normal: Any, wanted: Float64) -> bool:
        return not wanted.any() or turned * float(np.dot(normal, wanted)) > FACING_COSINE

    found: set[int] = set()
    for point, wanted in zip(points - middle, normals, strict=True):
        found |= {row for _, normal, row, _ in tree.find_nearest_range(point, radius) if faces_alike(normal, wanted)}
        # Under a curved surface a light may lie deeper than the radius.
        place, normal, row, distance = tree.ray_cast(point, -wanted) if wanted.any() else (None, None, 0, 0.0)
        if place is not None and distance < _extent(vertices[rings[row]]) and faces_alike(normal, wanted):
            found.add(row)
    return found


def erase(context: Any, points: Float64, normals: Float64, radius: float) -> str:
    """Delete the unlocked lights under a stroke from the chosen light meshes; returns a sentence with counts.

    Raises InvalidInput; nothing is changed then.
    """
    if not len(points):
        raise InvalidInput("stroke", "it has no points", "give points on the surface")
    return _change(context, lambda thing: lights_near(thing, points, normals, radius), _delete, "Erased")


def cut(context: Any, points: Float64, normals: Float64) -> str:
    """Cut the unlocked lights along the way through `points`; each part keeps colour, tag and all else.

    points: (n, 3) world, n at least 2; normals: (n, 3), of the surface: the cut goes straight into it. A light that
    the way ends in is cut through. Returns a sentence with counts. Raises InvalidInput; nothing is changed then.
    """
    if len(points) < 2:
        raise InvalidInput("cut", f"{len(points)} points are no way across", "give at least two")
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
    return f"Cut {after - before} time{'s' if after - before > 1 else ''}: {after} lights"


def require_all_editable(context: Any) -> None:
    """Raises InvalidInput where one of the chosen light meshes cannot be changed."""
    for thing in chosen_light_meshes(context):
        require_editable(thing)


def _change(
    context: Any, find: Callable[[Any], set[int]], change: Callable[[Any, Sequence[Any]], None], verb: str
) -> str:
    require_all_editable(context)
    changed = kept = left = 0
    for thing in chosen_light_meshes(context):
        found = find(thing)
        rows = found - _locked(thing)
        kept += len(found) - len(rows)
        if rows:
            with edited(thing) as mesh:
                change(mesh, [face for face in mesh.faces if face.index in rows])
                left += len(mesh.faces)
        changed += len(rows)
    if not changed:
        if kept:
            raise InvalidInput("stroke", f"the {kept} lights under it are locked", "unlock them first")
        raise InvalidInput("stroke", "no light is under it", "select the light mesh, or use a larger radius")
    locked = f"; {kept} locked ones kept" if kept else ""
    return f"{verb} {changed} light{'s' if changed > 1 else ''}{locked}" + ("" if left else "; none is left")


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


def _delete(mesh: Any, faces: Sequence[Any]) -> None:
    bmesh.ops.delete(mesh, geom=list(faces), context="FACES")


def _locked(thing: Any) -> set[int]:
    return set(np.flatnonzero(read_faces(thing, LOCK_ATTRIBUTE)).tolist())


def _means(normals: Float64) -> Float64:
    sums = normals[:-1] + normals[1:]
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    means: Float64 = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0)
    return means
