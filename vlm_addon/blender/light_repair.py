# SPDX-License-Identifier: GPL-3.0-or-later
"""One-click fixes of what the check finds: core/repair.py's arrays written into the light meshes of the open file.

One kind of finding at a time: what one fix changes decides what the next one finds. Lights that modifiers made, linked
light meshes and, for moving, light meshes that are deformed are left alone and said to be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bmesh
import bpy
import numpy as np

from ..core import finding_kinds as kinds
from ..core.errors import InvalidInput
from ..core.light_marks import LightHistory
from ..core.light_mesh import VirtualLightMesh
from ..core.mesh_topology import Int64
from ..core.progress import Progress
from ..core.repair import Repair, fix
from ..core.scene import Float64
from ..core.validate import check_light_mesh
from .authoring import lights
from .checking import extract_edited
from .extraction.light_mesh_io import LightOrigins
from .findings import TAGGED, fixable, fixable_kinds
from .light_faces import face_count, read_faces, write_faces
from .light_history import light_history
from .light_meshes import is_local, light_meshes
from .names import (
    AREA_SCALE_ATTRIBUTE,
    COLOR_ATTRIBUTE,
    EMISSION_ATTRIBUTE,
    HUE_PROPERTY,
    STRENGTH_PROPERTY,
    TAG_ATTRIBUTE,
)
from .tagging.tag_pairing import Retagged, pair_lights, paired_text, read_tagging, write_retagged


@dataclass(frozen=True)
class Repaired:
    """One fix that is yet to be written. lights: rows it is about, none where there was nothing to fix."""

    kind: str
    lights: Int64
    light_mesh: VirtualLightMesh
    origins: LightOrigins
    repair: Repair | None


Fixed = Repaired | Retagged
"""What a step of fixing gives: a repair of lights, or new tags."""


def kinds_to_fix(scene: Any, kind: str) -> list[str]:
    """The kind alone, or with "" all kinds of the kept findings that can be fixed but for those that may be meant.

    Raises InvalidInput where there is nothing to fix.
    """
    if kind:
        if not fixable(kind):
            raise InvalidInput(f"finding {kind!r}", "there is no fix for it", "select its lights and mend them by hand")
        return [kind]
    found = fixable_kinds(scene)
    if not found:
        problem = "none of them can be fixed by itself"
        raise InvalidInput("findings", problem, "run Check, and fix what may be meant by its own button")
    return found


def work_on(context: Any, kind: str) -> Callable[[Progress], Fixed]:
    """Work that looks for findings of one kind now, and for what mends them. Raises InvalidInput."""
    found = extract_edited(context)
    light_mesh, origins = found.light_mesh, found.origins
    if light_mesh is None or origins is None:
        raise InvalidInput("scene", "it has no virtual lights", "create some first")
    history = light_history(context.scene, found)
    if kind in TAGGED:
        rows = _rows(kind, light_mesh, found.snapshot.meshes, history)
        return _tag_work(context, origins.faces_by_object(rows))

    def work(progress: Progress) -> Repaired:
        rows = _rows(kind, light_mesh, found.snapshot.meshes, history)
        repair = None
        if len(rows):
            repair = fix(kind, light_mesh, found.snapshot.meshes, rows, polygon_of_light=_polygons(origins))
        return Repaired(kind, rows, light_mesh, origins, repair)

    return work


def _polygons(origins: LightOrigins) -> Int64:
    """(n,) a number of the face that each light is part of; lights that modifiers made are by themselves."""
    faces = origins.faces.astype(np.int64)
    stored = origins.owner * (int(faces.max(initial=0)) + 1) + faces
    return np.where(faces >= 0, stored, -1 - np.arange(len(faces)))


def _rows(kind: str, light_mesh: VirtualLightMesh, meshes: Any, history: LightHistory | None) -> Int64:
    findings = check_light_mesh(light_mesh, meshes, history=history)
    rows = [row for finding in findings if finding.kind == kind for row in finding.lights]
    return np.unique(np.array(rows, np.int64))


def _tag_work(context: Any, faces: dict[str, Any]) -> Callable[[Progress], Retagged]:
    """Work that pairs some faces of the light meshes with what they stand for."""
    things = [thing for thing in light_meshes(context.scene) if thing.name in faces and is_local(thing)]
    tagging = read_tagging(context, things)
    chosen = [np.zeros(face_count(thing), bool) for thing in things]
    for rows, thing in zip(chosen, things, strict=True):
        rows[faces[thing.name]] = True
    joined = np.concatenate([np.zeros(0, bool), *chosen])
    return lambda progress: pair_lights(tagging, joined, progress)


def write_fixed(context: Any, made: Fixed) -> str:
    """Write one fix; returns what was done in words. Raises VlmError before anything is written."""
    if isinstance(made, Retagged):
        return paired_text(made, write_retagged(context, made))
    if made.repair is None:
        return f"nothing is {made.kind.replace('_', ' ')} any more"
    with _object_mode(context):
        if made.kind in kinds.BROKEN:
            return f"Mended the values of {lights(_mend_values(context.scene))}"
        left_out = _write_repair(context.scene, made)
    sentence = made.repair.sentence
    if left_out:
        sentence += f"; left out {left_out[0]!r}{f' and {len(left_out) - 1} more' if len(left_out) > 1 else ''}"
        sentence += ", which modifiers or shape keys deform, or another file holds"
    return sentence


def work_after(context: Any, made: Fixed) -> Callable[[Progress], Fixed] | None:
    """What a written fix leaves to do: tags for lights that could not be moved far enough. Raises VlmError."""
    if isinstance(made, Retagged) or made.repair is None or made.repair.tag_ids is None:
        return None
    if made.kind == kinds.LOST_TAG:
        return None
    tagged = np.flatnonzero(made.repair.tag_ids != made.light_mesh.tag_ids)
    return _tag_work(context, made.origins.faces_by_object(tagged))


@contextmanager
def _object_mode(context: Any) -> Iterator[None]:
    """Meshes that are edited are in object mode meanwhile."""
    edited = context.mode == "EDIT_MESH"
    if edited:
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield
    finally:
        if edited:
            bpy.ops.object.mode_set(mode="EDIT")


def _mend_values(scene: Any) -> int:
    """What is not finite becomes neutral and what is negative 0, in faces and factors; returns how many lights had."""
    changed = 0
    for thing in filter(is_local, light_meshes(scene)):
        wrong = np.zeros(face_count(thing), bool)
        for name, neutral in ((COLOR_ATTRIBUTE, 0.0), (EMISSION_ATTRIBUTE, 0.0), (AREA_SCALE_ATTRIBUTE, 1.0)):
            if name not in thing.data.attributes:
                continue
            values = read_faces(thing, name)
            mended = np.maximum(np.where(np.isfinite(values), values, np.float32(neutral)), 0.0)
            differs = (mended != values).reshape(len(wrong), -1).any(axis=1)
            if differs.any():
                write_faces(thing, name, mended)
            wrong |= differs
        for name in (STRENGTH_PROPERTY, HUE_PROPERTY):
            if name in thing:
                factors = np.atleast_1d(np.array(thing[name], np.float64))
                sound = np.maximum(np.where(np.isfinite(factors), factors, 1.0), 0.0)
                if not np.array_equal(factors, sound):
                    thing[name] = sound.tolist() if len(sound) > 1 else float(sound[0])
                    wrong[:] = True
        changed += int(wrong.sum())
    return changed


def _write_repair(scene: Any, made: Repaired) -> list[str]:
    """Write a repair into the light meshes; returns the names of those that it could not be written into."""
    assert made.repair is not None
    ends = np.cumsum(made.origins.vertex_counts)
    left_out, seen = [], set()
    for number, name in enumerate(made.origins.objects):
        thing = scene.objects.get(name)
        rows = np.flatnonzero(made.origins.owner == number)
        vertices = slice(int(ends[number]) - made.origins.vertex_counts[number], int(ends[number]))
        if not _touches(made, rows, vertices):
            continue
        moves = made.repair.vertices is not None and not _is_rigid(thing, made.origins.vertex_counts[number])
        unknown = (made.origins.faces[rows] < 0).any()
        if thing is None or not is_local(thing) or thing.data.name in seen or moves or unknown:
            left_out.append(name)
            continue
        seen.add(thing.data.name)
        _write_values(thing, made, rows)
        _write_geometry(thing, made, rows, vertices)
    return left_out


def _touches(made: Repaired, rows: Int64, vertices: slice) -> bool:
    repair = made.repair
    assert repair is not None
    moved = repair.vertices is not None and (repair.vertices[vertices] != made.light_mesh.vertices[vertices]).any()
    return bool(moved) or bool(np.isin(made.lights, rows).any())


def _is_rigid(thing: Any, vertex_count: int) -> bool:
    """Whether the vertices of a light mesh are where they are stored."""
    deformed = thing is not None and (len(thing.modifiers) or thing.data.shape_keys is not None)
    return thing is not None and not deformed and len(thing.data.vertices) == vertex_count


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
