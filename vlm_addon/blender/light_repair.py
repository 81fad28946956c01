# SPDX-License-Identifier: GPL-3.0-or-later
"""One-click fixes of what the check finds: core/repair.py's arrays written into the light meshes of the open file.

One kind of finding at a time: what one fix changes decides what the next one finds. Lights that modifiers made, linked
light meshes and, for moving, light meshes that are deformed or shown by instances are left alone and said to be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..core import finding_kinds as kinds
from ..core.errors import InvalidInput
from ..core.light_marks import LightHistory
from ..core.light_mesh import VirtualLightMesh
from ..core.mesh_topology import Int64
from ..core.progress import Progress
from ..core.repair import fix
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
)
from .stored_values import set_value
from .tagging.tag_pairing import Retagged, pair_lights, paired_text, read_tagging, write_retagged
from .write_repair import Repaired, stored_light_mesh, write_repair


@dataclass(frozen=True)
class ToPair:
    """Lights, (n,) rows, that are yet to be paired with what they stand for."""

    lights: Int64
    origins: LightOrigins


Fixed = Repaired | ToPair | Retagged
"""What a step of fixing gives: a repair of lights, lights that need tags, or new tags."""


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

    def work(progress: Progress) -> Fixed:
        rows = _rows(kind, light_mesh, found.snapshot.meshes, history)
        if kind in TAGGED:
            return ToPair(rows, origins)
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


def _tag_work(context: Any, rows: Int64, origins: LightOrigins) -> Callable[[Progress], Retagged]:
    """Work that pairs some lights with what they stand for. Raises InvalidInput where their light meshes changed."""
    faces = origins.faces_by_object(rows)
    numbers = {name: number for number, name in enumerate(origins.objects)}
    found = [stored_light_mesh(context.scene, origins, numbers[name]) for name in sorted(faces)]
    things = [thing for thing in found if thing is not None]
    tagging = read_tagging(context, things)
    chosen = [np.zeros(face_count(thing), bool) for thing in things]
    for rows, thing in zip(chosen, things, strict=True):
        rows[faces[thing.name]] = True
    joined = np.concatenate([np.zeros(0, bool), *chosen])
    return lambda progress: pair_lights(tagging, joined, progress)


def write_fixed(context: Any, made: Fixed) -> str:
    """Write one fix; returns what was done in words, "" where nothing is yet. Raises VlmError before it writes."""
    if isinstance(made, ToPair):
        return ""
    if isinstance(made, Retagged):
        return paired_text(made, write_retagged(context, made))
    if made.repair is None:
        return f"nothing is {made.kind.replace('_', ' ')} any more"
    with _object_mode(context):
        if made.kind in kinds.BROKEN:
            return f"Mended the values of {lights(_mend_values(context.scene))}"
        left_out = write_repair(context.scene, made)
    sentence = made.repair.sentence
    for reason, names in left_out.items():
        sentence += f"; left out {names[0]!r}{f' and {len(names) - 1} more' if len(names) > 1 else ''}, {reason}"
    return sentence


def work_after(context: Any, made: Fixed) -> Callable[[Progress], Fixed] | None:
    """What a fix leaves to do: tags, for lights that could not be moved far enough as well. Raises VlmError."""
    if isinstance(made, ToPair):
        return _tag_work(context, made.lights, made.origins)
    if isinstance(made, Retagged) or made.repair is None or made.repair.tag_ids is None:
        return None
    if made.kind == kinds.LOST_TAG:
        return None
    tagged = np.flatnonzero(made.repair.tag_ids != made.light_mesh.tag_ids)
    return _tag_work(context, tagged, made.origins)


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
                    set_value(thing, name, sound.tolist() if len(sound) > 1 else float(sound[0]))
                    wrong[:] = True
        changed += int(wrong.sum())
    return changed
