# SPDX-License-Identifier: GPL-3.0-or-later
"""Tag ids in the open file: given and taken away by hand, on faces in edit mode and on whole objects in object mode.

A visible object carries an id for all of it (`vlm_tag`) and its faces ids of their own, which win; the faces of a light
mesh carry ids. Surfaces leave out the lights of their own id.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...core.errors import InvalidInput
from ...core.scene import UNTAGGED, Int32
from ...core.tag_pairs import FIRST_AUTOMATIC, is_automatic
from ...core.tags import next_tag
from ..interface.availability import has_geometry
from ..light_colors import one_per_mesh
from ..light_faces import chosen_faces, read_faces, write_faces
from ..light_meshes import LARGEST_ID, is_local, require_editable, tags_of
from ..names import TAG_ATTRIBUTE, TAG_PROPERTY, is_light_mesh
from ..stored_values import remove_value, set_value
from .shown_things import instanced_ids, shown_things
from .stored_links import read_links, write_links


@dataclass(frozen=True)
class Tagged:
    """What was tagged: the id, lights, faces of visible objects, objects as a whole, objects whose faces keep ids of
    their own because others share the mesh, and objects whose instances keep theirs."""

    tag: int
    lights: int
    faces: int
    objects: int
    shared: int
    instanced: int = 0


def chosen_things(context: Any) -> list[Any]:
    """What tags are given to: the meshes in edit mode, or the selected light meshes and visible objects."""
    if context.mode == "EDIT_MESH":
        return one_per_mesh(list(context.objects_in_mode_unique_data))
    chosen = (thing for thing in context.selected_objects if is_light_mesh(thing) or has_geometry(thing))
    return sorted(chosen, key=lambda thing: thing.name)


def tag_problem(context: Any) -> str | None:
    """Why there is nothing to give a tag to, or None."""
    if context.mode not in ("OBJECT", "EDIT_MESH"):
        return "Leave this mode first: tags are given in Object Mode (whole objects) or Edit Mode (selected faces)"
    chosen = chosen_things(context)
    if not chosen:
        return "Select light meshes and the objects that they stand for, or edit them and select faces"
    linked = next((thing for thing in chosen if not _can_write(thing)), None)
    return f"{linked.name} is linked from another file: make it local first" if linked is not None else None


def unused_tag(count: int = 1) -> int:
    """The first of `count` ids above all that artists have given to lights, surfaces and links: a link whose lights or
    surfaces are gone is not to hold for others. Raises InvalidInput where there are not so many."""
    first = first_unused_tag()
    require_given(first + count - 1)
    return first


def first_unused_tag() -> int:
    """The same, whether or not there is such an id: `require_given` says."""
    used = used_tags()
    return next_tag(used[~is_automatic(used)])


def require_given(largest: int) -> None:
    """Raises InvalidInput where new ids as artists give them, up to `largest`, run over into those of pairing."""
    if is_automatic(largest):
        problem = f"the largest tag id that can be given by hand, {FIRST_AUTOMATIC - 1}, is in use or soon would be"
        raise InvalidInput("tags", problem, "give a smaller one to what carries it (Assign Tag)")


def unused_automatic_tag() -> int:
    """The least id above all of the file that pairing may give. Raises InvalidInput without any."""
    tag = max(next_tag(used_tags()), FIRST_AUTOMATIC)
    if tag > LARGEST_ID // 2:
        raise InvalidInput("tags", f"the tag id {tag - 1} is in use", "clear the largest ones (Clear Tag)")
    return tag


def used_tags() -> Int32:
    """All ids that lights, surfaces and links of the file carry, each once."""
    surfaces = [tags_of(thing) for thing in bpy.data.objects if not is_light_mesh(thing)]
    return np.unique(np.concatenate([tags_of_lights(), *surfaces]))


def tags_of_lights(replaced: Any = None, links: bool = True) -> Int32:
    """All ids that lights of the file carry, those of the light mesh `replaced` left out, each once. links: and those
    that their links name."""
    things = [each for each in bpy.data.objects if is_light_mesh(each) and each.type == "MESH" and each != replaced]
    found = [*map(tags_of, things), *(read_links(thing).ravel() for thing in things if links)]
    return np.unique(np.concatenate([np.zeros(0, np.int32), *found]))


def assign_tag(context: Any, tag: int) -> Tagged:
    """Give `tag`, or a new id for UNTAGGED, to the chosen faces or objects. Raises InvalidInput."""
    return _tag(context, chosen_things(context), tag if tag != UNTAGGED else unused_tag())


def clear_tag(context: Any) -> Tagged:
    """Take the ids of the chosen faces or objects away, with links from ids that a light mesh no longer has."""
    things = chosen_things(context)
    cleared = _tag(context, things, UNTAGGED)
    for thing in things:
        if is_light_mesh(thing) and thing.mode == "OBJECT":
            links = read_links(thing)
            kept = links[np.isin(links[:, 0], tags_of(thing))]
            if len(kept) < len(links):
                write_links(thing, kept)
    return cleared


def _tag(context: Any, things: Sequence[Any], tag: int) -> Tagged:
    _require_writable(things)
    shown = shown_things(context) if any(thing.mode != "EDIT" and not is_light_mesh(thing) for thing in things) else {}
    instanced = 0
    lights = faces = objects = shared = 0
    for thing in things:
        if is_light_mesh(thing) or thing.mode == "EDIT":
            changed = _tag_faces(thing, tag)
            lights, faces = (lights + changed, faces) if is_light_mesh(thing) else (lights, faces + changed)
            continue
        if tag != UNTAGGED:
            set_value(thing, TAG_PROPERTY, tag)
        else:
            remove_value(thing, TAG_PROPERTY)
        objects += 1
        if thing.type == "MESH" and read_faces(thing, TAG_ATTRIBUTE).any():
            users = {each.name for each in bpy.data.objects if each.data == thing.data}
            if users <= {each.name for each in things}:
                _untag_faces(thing)
            else:
                shared += 1
        instanced += tag != UNTAGGED and instanced_ids(thing, shown)
    return Tagged(tag, lights, faces, objects, shared, instanced)


def _tag_faces(thing: Any, tag: int) -> int:
    chosen = chosen_faces(thing)
    if chosen.any():
        tags = read_faces(thing, TAG_ATTRIBUTE)
        tags[chosen] = tag
        write_faces(thing, TAG_ATTRIBUTE, tags)
    return int(chosen.sum())


def _untag_faces(thing: Any) -> None:
    """Faces follow their object again."""
    write_faces(thing, TAG_ATTRIBUTE, np.full_like(read_faces(thing, TAG_ATTRIBUTE), UNTAGGED))


def _can_write(thing: Any) -> bool:
    return is_local(thing) if thing.type == "MESH" else thing.library is None and thing.override_library is None


def _require_writable(things: Sequence[Any]) -> None:
    """Raises InvalidInput for the first thing that belongs to another file or version."""
    for thing in things:
        if is_light_mesh(thing):
            require_editable(thing)
        elif not _can_write(thing):
            remedy = "make it local (Object > Relations > Make Local)"
            raise InvalidInput(f"object {thing.name!r}", "it is linked from another file", remedy)


def tagged_text(tagged: Tagged) -> str:
    """A sentence with counts."""
    verb = f"Tag {tagged.tag} for" if tagged.tag != UNTAGGED else "No tag for"
    parts = [counted(tagged.lights, "light"), counted(tagged.faces, "face"), counted(tagged.objects, "object")]
    told = f"{verb} {', '.join(part for part in parts if part)}"
    if tagged.shared:
        told += f"; faces of {counted(tagged.shared, 'object')} keep theirs: others share the mesh"
    if tagged.instanced:
        what = "1 object instances keeps its own id" if tagged.instanced == 1 else "these instance keeps its own ids"
        told += f"; what {what}: clear that first (Clear Tag), all instances have it"
    return told


def report_tagged(operator: Any, tagged: Tagged) -> set[str]:
    """What an operator that tags reports and returns."""
    if not tagged.lights + tagged.faces + tagged.objects:
        operator.report({"WARNING"}, "No tag was changed: select faces")
        return {"CANCELLED"}
    operator.report({"INFO"}, tagged_text(tagged))
    return {"FINISHED"}


def counted(number: int, noun: str) -> str:
    """A number of things in words, "" for none."""
    return "" if not number else f"1 {noun}" if number == 1 else f"{number:,} {noun}s"


def write_tags(thing: Any, tags: Int32) -> None:
    """Write ids of all faces of a mesh object where they differ from what it has."""
    if not np.array_equal(read_faces(thing, TAG_ATTRIBUTE), tags):
        write_faces(thing, TAG_ATTRIBUTE, tags)
