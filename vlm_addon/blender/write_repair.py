# SPDX-License-Identifier: GPL-3.0-or-later
"""What one fix changes (core/repair.py), written into the light meshes that its lights come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bmesh
import numpy as np

from ..core import finding_kinds as kinds
from ..core.light_mesh import VirtualLightMesh
from ..core.mesh_topology import Int64
from ..core.repair import Repair
from ..core.scene import Float64
from .extraction.light_mesh_io import LightOrigins
from .light_faces import face_count, read_faces, write_faces
from .light_meshes import is_local, unchanged_light_mesh
from .names import AREA_SCALE_ATTRIBUTE, COLOR_ATTRIBUTE, TAG_ATTRIBUTE

DEFORMED = "which modifiers or shape keys deform"
LINKED = "which another file holds"
INSTANCED = "which instances show elsewhere"
SHARED = "whose mesh another light mesh has, too"


@dataclass(frozen=True)
class Repaired:
    """One fix that is yet to be written. lights: rows it is about, none where there was nothing to fix."""

    kind: str
    lights: Int64
    light_mesh: VirtualLightMesh
    origins: LightOrigins
    repair: Repair | None


@dataclass(frozen=True)
class _Part:
    """What of a repair goes into one light mesh: its lights, (n,) rows, and its vertices among all."""

    thing: Any
    lights: Int64
    vertices: slice


def write_repair(scene: Any, made: Repaired) -> dict[str, list[str]]:
    """Write a repair into the light meshes; returns the names of those that it could not be written into, by reason.

    Raises InvalidInput, before anything is written, where one of them was changed since.
    """
    parts, left_out = _parts(scene, made)
    for part in parts:
        _write_values(part.thing, made, part.lights)
        _write_geometry(part.thing, made, part.lights, part.vertices)
    return left_out


def _parts(scene: Any, made: Repaired) -> tuple[list[_Part], dict[str, list[str]]]:
    assert made.repair is not None
    origins = made.origins
    ends = np.cumsum(origins.vertex_counts)
    parts: list[_Part] = []
    left_out: dict[str, list[str]] = {}
    mended: dict[str, Int64] = {}
    for number, name in enumerate(origins.objects):
        rows = np.flatnonzero(origins.owner == number)
        vertices = slice(int(ends[number]) - origins.vertex_counts[number], int(ends[number]))
        if not _touches(made, rows, vertices):
            continue
        thing = stored_light_mesh(scene, origins, number)
        faces = np.unique(origins.faces[np.intersect1d(rows, made.lights)])
        reason = _obstacle(thing, made, number, rows)
        if thing is None or reason is not None:
            left_out.setdefault(reason or LINKED, []).append(name)
        elif thing.data.name not in mended:
            mended[thing.data.name] = faces
            parts.append(_Part(thing, rows, vertices))
        elif made.repair.vertices is not None or not np.isin(faces, mended[thing.data.name]).all():
            left_out.setdefault(SHARED, []).append(name)
    return parts, left_out


def stored_light_mesh(scene: Any, origins: LightOrigins, number: int) -> Any | None:
    """The light mesh object that lights come from, None where it is not in the scene itself or of another file.

    Raises InvalidInput where it was changed since its faces were numbered.
    """
    name = origins.objects[number]
    thing = scene.objects.get(name)
    if origins.instanced[number] if thing is None else not is_local(thing):
        return None
    return unchanged_light_mesh(scene, name, origins.face_counts[number], "its lights were judged", "fix it again")


def _obstacle(thing: Any | None, made: Repaired, number: int, rows: Int64) -> str | None:
    """Why a repair cannot be written into a light mesh, None where it can."""
    assert made.repair is not None
    origins, moves = made.origins, made.repair.vertices is not None
    if origins.instanced[number] and (thing is None or moves):
        return INSTANCED
    if thing is None:
        return LINKED
    unknown = (origins.faces[rows] < 0).any()
    return DEFORMED if unknown or (moves and not _is_rigid(thing, origins.vertex_counts[number])) else None


def _touches(made: Repaired, rows: Int64, vertices: slice) -> bool:
    repair = made.repair
    assert repair is not None
    moved = repair.vertices is not None and (repair.vertices[vertices] != made.light_mesh.vertices[vertices]).any()
    return bool(moved) or bool(np.isin(made.lights, rows).any())


def _is_rigid(thing: Any, vertex_count: int) -> bool:
    """Whether the vertices of a light mesh are where they are stored."""
    deformed = len(thing.modifiers) or thing.data.shape_keys is not None
    return not deformed and len(thing.data.vertices) == vertex_count


def _write_values(thing: Any, made: Repaired, rows: Int64) -> None:
    """Colours, strengths and tags of the lights `rows`, into the faces that they are parts of."""
    repair, before = made.repair, made.light_mesh
    assert repair is not None
    faces = made.origins.faces[rows]
    if repair.colour is not None:
        factor = np.ones(face_count(thing))
        factor[faces] = _ratio(repair.colour[rows].max(axis=1), before.colour[rows].max(axis=1))
        color = read_faces(thing, COLOR_ATTRIBUTE)
        color[:, :3] *= factor[:, None]
        write_faces(thing, COLOR_ATTRIBUTE, color)
    if repair.strength is not None:
        factor = np.ones(face_count(thing))
        factor[faces] = _ratio(repair.strength[rows], before.strength[rows])
        write_faces(thing, AREA_SCALE_ATTRIBUTE, read_faces(thing, AREA_SCALE_ATTRIBUTE) * factor)
    if repair.tag_ids is not None and made.kind == kinds.LOST_TAG:
        tags = read_faces(thing, TAG_ATTRIBUTE)
        tags[faces] = repair.tag_ids[rows]
        write_faces(thing, TAG_ATTRIBUTE, tags)


def _ratio(after: Any, before: Any) -> Float64:
    one, other = np.asarray(after, np.float64), np.asarray(before, np.float64)
    return np.divide(one, other, out=np.ones_like(one), where=other > 0.0)


def _write_geometry(thing: Any, made: Repaired, rows: Int64, vertices: slice) -> None:
    """Moved vertices, faces turned over and faces taken away."""
    repair = made.repair
    assert repair is not None
    flipped = np.unique(made.origins.faces[np.intersect1d(rows, repair.flipped)])
    deleted = np.unique(made.origins.faces[np.intersect1d(rows, repair.deleted)])
    moved = np.zeros(0, np.int64)
    if repair.vertices is not None:
        moved = np.flatnonzero((repair.vertices[vertices] != made.light_mesh.vertices[vertices]).any(axis=1))
    if not len(flipped) + len(deleted) + len(moved):
        return
    mesh = bmesh.new()
    try:
        mesh.from_mesh(thing.data)
        mesh.verts.ensure_lookup_table()
        mesh.faces.ensure_lookup_table()
        if repair.vertices is not None:
            to_local = np.linalg.inv(np.array(thing.matrix_world, np.float64))
            local = repair.vertices[vertices][moved] @ to_local[:3, :3].T + to_local[:3, 3]
            for vertex, place in zip(moved.tolist(), local.tolist(), strict=True):
                mesh.verts[vertex].co = place
        for face in flipped.tolist():
            mesh.faces[face].normal_flip()
        bmesh.ops.delete(mesh, geom=[mesh.faces[face] for face in deleted.tolist()], context="FACES")
        mesh.to_mesh(thing.data)
    finally:
        mesh.free()
    thing.data.update()
