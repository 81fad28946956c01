# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last check found, as the scene keeps it: sentences for the sidebar, and the faces that they are about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..core import finding_kinds as kinds
from ..core.counting import counted
from ..core.errors import InvalidInput
from ..core.repair import can_fix
from ..core.scene import Finding
from ..core.spans import numbers_in, parse_spans, spans_text
from .extraction.light_mesh_io import LightOrigins
from .light_faces import face_count, select_faces
from .light_meshes import is_local, light_meshes

Int64 = npt.NDArray[np.int64]

CHECK_AGAIN = "run Check again"
TAGGED = (kinds.THIN, kinds.TWO_SIDED)
"""Kinds whose fix is a tag: Blender's faces get them, not triangles."""
MEANT = (kinds.BRIGHT, kinds.OVERLAPPING)
"""Kinds that an artist may have wanted, or that may be told where nothing is wrong (lights of crossing or stacked
surfaces look as if they overlapped): only their own button mends them."""


class VLM_PG_mark(bpy.types.PropertyGroup):  # noqa: N801 (Blender's naming of classes)
    """Faces of one light mesh that a finding is about. face_count: of the light mesh when it was checked."""

    owner: bpy.props.StringProperty(name="Light Mesh")  # type: ignore[valid-type]
    faces: bpy.props.StringProperty(name="Faces")  # type: ignore[valid-type]
    face_count: bpy.props.IntProperty(name="Face Count")  # type: ignore[valid-type]


class VLM_PG_finding(bpy.types.PropertyGroup):  # noqa: N801
    """One sentence of the last check. kind: what `vlm.fix_findings` knows it by; fixable: whether it can mend it."""

    text: bpy.props.StringProperty(name="Finding")  # type: ignore[valid-type]
    fixable: bpy.props.BoolProperty(name="Can Be Fixed")  # type: ignore[valid-type]
    kind: bpy.props.StringProperty(name="Kind")  # type: ignore[valid-type]
    marks: bpy.props.CollectionProperty(type=VLM_PG_mark, name="Faces")  # type: ignore[valid-type]


CLASSES = (VLM_PG_mark, VLM_PG_finding)


def list_findings(scene: Any, findings: Sequence[Finding], origins: LightOrigins | None = None) -> None:
    """Keep the findings in `scene`, in place of those before. origins: of the lights that the findings name; light
    meshes are not looked at, they may have changed since."""
    scene.vlm.findings.clear()
    for finding in findings:
        item = scene.vlm.findings.add()
        item.text, item.kind, item.fixable = str(finding), finding.kind, fixable(finding.kind)
        if origins is None or not finding.lights:
            continue
        counts = dict(zip(origins.objects, origins.face_counts, strict=True))
        for owner, rows in origins.faces_by_object(finding.lights).items():
            mark = item.marks.add()
            mark.owner, mark.faces = owner, spans_text(rows)
            mark.face_count = counts[owner]


def fixable(kind: str) -> bool:
    """Whether there is a fix for findings of this kind."""
    return kind in TAGGED or can_fix(kind)


def fixable_kinds(scene: Any) -> list[str]:
    """Kinds of the kept findings that can be fixed, each once, but for those that an artist may have meant."""
    return list(dict.fromkeys(item.kind for item in scene.vlm.findings if item.fixable and item.kind not in MEANT))


def marked_faces(scene: Any, item: Any) -> dict[str, Int64]:
    """Faces, (n,) int64 ascending, by the name of their light mesh, of one kept finding.

    Raises InvalidInput where a light mesh is gone or has another number of faces than when it was checked.
    """
    found = {}
    present = {thing.name: thing for thing in light_meshes(scene)}
    for mark in item.marks:
        if mark.owner not in present:
            raise InvalidInput(f"light mesh {mark.owner!r}", "it is gone or was renamed since the check", CHECK_AGAIN)
        now = face_count(present[mark.owner])
        if now != mark.face_count:
            problem = f"it has {counted(now, 'face')} and had {mark.face_count} when it was checked"
            raise InvalidInput(f"light mesh {mark.owner!r}", problem, CHECK_AGAIN)
        found[mark.owner] = numbers_in(parse_spans(mark.faces, "face", 0))
    return found


def kept_finding(scene: Any, index: int) -> Any:
    """The finding of that number in the list. Raises InvalidInput where there is none."""
    if not 0 <= index < len(scene.vlm.findings):
        problem = f"there is no finding {index}, the last check has {len(scene.vlm.findings)}"
        raise InvalidInput("findings", problem, CHECK_AGAIN)
    return scene.vlm.findings[index]


def select_offenders(context: Any, index: int) -> int:
    """Edit the light meshes that a finding names, with just its faces selected; returns how many there are.

    Raises InvalidInput where the finding names no faces, or they cannot be shown.
    """
    scene = context.scene
    faces = marked_faces(scene, kept_finding(scene, index))
    if not faces:
        raise InvalidInput(f"finding {index}", "it is about no faces of a light mesh", "read what to do in its text")
    things = [scene.objects[name] for name in faces]
    for thing in things:
        if not is_local(thing):
            raise InvalidInput(f"light mesh {thing.name!r}", "it is linked from another file", "make it local first")
        if not thing.visible_get(view_layer=context.view_layer):
            raise InvalidInput(f"light mesh {thing.name!r}", "it is hidden", "show it in the outliner")
    if set(context.objects_in_mode) != set(things) or context.mode != "EDIT_MESH":
        _edit(context, things)
    context.tool_settings.mesh_select_mode = (False, False, True)
    for thing in things:
        chosen = np.zeros(face_count(thing), bool)
        chosen[faces[thing.name]] = True
        select_faces(thing, chosen)
    return sum(len(rows) for rows in faces.values())


def _edit(context: Any, things: list[Any]) -> None:
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    # None for what a script has deleted just now
    for thing in filter(None, context.view_layer.objects):
        thing.select_set(thing in things)
    context.view_layer.objects.active = things[0]
    bpy.ops.object.mode_set(mode="EDIT")
