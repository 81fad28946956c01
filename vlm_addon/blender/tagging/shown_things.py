# SPDX-License-Identifier: GPL-3.0-or-later
"""What objects show besides themselves: instances of other objects, whose ids all their instances have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...core.errors import InvalidInput
from ...core.scene import UNTAGGED
from ..light_faces import read_faces
from ..names import TAG_ATTRIBUTE, TAG_PROPERTY, is_light_mesh
from ..stored_values import whole_number

Shown = dict[str, dict[str, Any]]
"""By the name of each visible object: by its name, each object whose surface it shows, itself or as an instance."""


def shown_things(context: Any) -> Shown:
    """What the visible objects of the view layer show."""
    found: Shown = {}
    for instance in context.evaluated_depsgraph_get().object_instances:
        thing = instance.object.original
        owner = instance.parent.original if instance.is_instance else thing
        if not is_light_mesh(thing):
            found.setdefault(owner.name, {})[thing.name_full] = thing
    return found


def instanced_ids(thing: Any, shown: Shown) -> bool:
    """Whether what the object instances has ids of its own, which win over that of the object."""
    others = (each for each in shown.get(thing.name, {}).values() if each != thing)
    return any(_own_tag(each) or _has_face_tags(each) for each in others)


def require_alone(receivers: Sequence[Any], shown: Shown) -> None:
    """Raises InvalidInput where others than `receivers` show faces or objects with ids that one of these shows: they
    cannot be told apart."""
    names = {thing.name for thing in receivers}
    users: dict[tuple[str, str], list[str]] = {}
    for owner, things in shown.items():
        for thing in things.values():
            for carrier in _carriers(thing, thing.name != owner):
                users.setdefault(carrier, []).append(owner)
    for owners in users.values():
        inside = [name for name in owners if name in names]
        outside = sorted({name for name in owners if name not in names})
        if inside and outside:
            which = f"{outside[0]!r}" + (f" and {len(outside) - 1} more" if len(outside) > 1 else "")
            remedy = "select these, too, or clear these ids (Clear Tag), or make it a single user (Object > Relations)"
            raise InvalidInput(f"object {inside[0]!r}", f"{which} shows the same faces, which have ids", remedy)


def _carriers(thing: Any, is_instance: bool) -> list[tuple[str, str]]:
    """What ids are stored on that an object shows: its mesh, and as an instance, itself."""
    found = [("mesh", thing.data.name_full)] if _has_face_tags(thing) else []
    return [*found, ("object", thing.name_full)] if is_instance and _own_tag(thing) else found


def _own_tag(thing: Any) -> bool:
    return whole_number(thing, TAG_PROPERTY) != UNTAGGED


def _has_face_tags(thing: Any) -> bool:
    return thing.type == "MESH" and bool(read_faces(thing, TAG_ATTRIBUTE).any())
