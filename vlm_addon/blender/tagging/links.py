# SPDX-License-Identifier: GPL-3.0-or-later
"""Which visible objects the lights of a light mesh leave out, as links between tag ids (core/light_links.py).

Links are stored on the light mesh object. They are pairs of ids, so that they hold for every light of the first id and
every surface of the second, whatever object carries it, and survive renaming, joining and creating lights anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...core.errors import InvalidInput
from ...core.light_links import is_link, make_links
from ...core.scene import UNTAGGED, Int32
from ...core.tag_pairs import is_automatic
from ..authoring import lights as lights_text
from ..interface.availability import has_geometry
from ..light_faces import chosen_faces, read_faces, write_faces
from ..light_meshes import chosen_light_meshes, is_local, light_meshes, require_editable, tags_of
from ..names import TAG_ATTRIBUTE, TAG_PROPERTY, is_light_mesh
from ..stored_values import set_value, whole_number
from .light_tags import tags_of_lights, unused_tag
from .shown_things import Shown, require_alone, shown_things
from .stored_links import read_links, read_paired_links, write_links
from .unused_ids import forget_unused

Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Linked:
    """What linking or unlinking did. pairs: of tag ids that were added or taken away. lights: that were chosen.
    receivers: objects. more_lights, more_receivers: lights and objects that were not chosen and carry the same ids."""

    pairs: int
    lights: int
    receivers: int
    more_lights: int
    more_receivers: int


def receiver_names(context: Any, text: str) -> list[str]:
    """Names, in order, of the visible objects that hold `text` in them: what an artist may let lights leave out."""
    names = (each.name for each in context.scene.objects if has_geometry(each))
    return sorted(name for name in names if text.casefold() in name.casefold())


def named_receivers(context: Any, name: str) -> list[Any]:
    """The object of that name, or all selected visible objects where the name is empty. Raises InvalidInput."""
    if not name:
        return sorted((thing for thing in context.selected_objects if has_geometry(thing)), key=lambda each: each.name)
    found = context.scene.objects.get(name)
    if found is None:
        raise InvalidInput(f"object {name!r}", "the scene has no object of this name", "name one that it has")
    if not has_geometry(found):
        problem = "it is a light mesh" if is_light_mesh(found) else "it shows no surface"
        raise InvalidInput(f"object {name!r}", problem, "name a visible object that is to be left out")
    return [found]


def link_receivers(context: Any, receivers: Sequence[Any]) -> Linked:
    """Let the chosen lights leave out `receivers`.

    Lights without a tag get a new id, one for each mesh; so does each receiver that has faces without any. Raises
    InvalidInput, before anything changes, without lights or receivers, for linked data that would have to change, and
    for what cannot be told apart from other objects.
    """
    chosen = _chosen_lights(context)
    if not receivers:
        remedy = "select the visible objects as well, or give the name of one"
        raise InvalidInput("receiver links", "there is no object to be left out", remedy)
    shown = shown_things(context)
    require_alone(receivers, shown)
    untagged = [each for each in chosen if (each.tags == UNTAGGED).any()]
    bare = [thing for thing in receivers if _needs_tag(thing)]
    for thing in bare:
        if not is_local(thing):
            remedy = f"make it local, or give it a tag in its own file (custom property {TAG_PROPERTY})"
            raise InvalidInput(f"object {thing.name!r}", "it is linked from another file and has no tag", remedy)
    count = len(untagged) + len(bare)
    first = unused_tag(count) if count else UNTAGGED
    ids = list(range(first, first + count))
    light_ids = {each.mesh: number for each, number in zip(untagged, ids, strict=False)}
    receiver_ids = dict(zip((thing.name_full for thing in bare), ids[len(untagged) :], strict=True))
    receiver_tags = np.unique(
        np.concatenate([[*_receiver_tags(thing, shown), *_own(receiver_ids, thing.name_full)] for thing in receivers])
    )
    made = {each.mesh: _products(_with_new(each.tags, light_ids.get(each.mesh)), receiver_tags) for each in chosen}
    things = chosen_light_meshes(context)
    stored = {thing.name: (read_links(thing), made.get(thing.data.name_full)) for thing in things}
    links = {name: make_links([*old.tolist(), *new]) for name, (old, new) in stored.items() if new is not None}
    if untagged or bare or any(len(links[name]) > len(stored[name][0]) for name in links):
        _leave_edit_mode(context)
    for each in untagged:
        tags = read_faces(each.thing, TAG_ATTRIBUTE)
        tags[each.faces & (tags == UNTAGGED)] = light_ids[each.mesh]
        write_faces(each.thing, TAG_ATTRIBUTE, tags)
    for thing in bare:
        set_value(thing, TAG_PROPERTY, receiver_ids[thing.name_full])
    for thing in things:
        if thing.name in links:
            write_links(thing, links[thing.name])
    added = sum(len(links[name]) - len(stored[name][0]) for name in links)
    pairs = np.concatenate([np.array(product, np.int64).reshape(-1, 2) for product in made.values()])
    return _told(context, added, chosen, receivers, pairs)


def unlink_receivers(context: Any, receivers: Sequence[Any]) -> Linked:
    """Let the chosen lights light `receivers` again, or all there is without any. Links that pairing has made stay; ids
    that are good for nothing any more go.

    A pair of ids is taken away wherever it is stored in the scene. Raises InvalidInput as `link_receivers`.
    """
    chosen = _chosen_lights(context)
    paired = np.concatenate([make_links([]), *(read_paired_links(thing) for thing in light_meshes(context.scene))])
    light_tags = _with_former(np.unique(np.concatenate([each.tags for each in chosen])), paired)
    shown = shown_things(context)
    receiver_tags = [tag for thing in receivers for tag in _receiver_tags(thing, shown)]
    remaining, gone = {}, [np.zeros((0, 2), np.int32)]
    for thing in light_meshes(context.scene):
        links = read_links(thing)
        taken = np.isin(links[:, 0], light_tags) & ~is_link(links, paired)
        if receivers:
            taken &= np.isin(links[:, 1], receiver_tags)
        if taken.any():
            require_editable(thing)
            remaining[thing.name] = links[~taken]
            gone.append(links[taken])
    if remaining:
        _leave_edit_mode(context)
    for name, links in remaining.items():
        write_links(context.scene.objects[name], links)
    pairs = np.concatenate(gone)
    told = _told(context, len(pairs), chosen, receivers, pairs)
    forget_unused(pairs)
    return told


def _with_former(light_tags: Int32, paired: Int32) -> Int32:
    """`light_tags` with ids that an artist gave, that pairing has put these in place of, and that no light has left."""
    former = paired[np.isin(paired[:, 0], light_tags) & ~is_automatic(paired[:, 1]), 1]
    return np.concatenate([light_tags, former[~np.isin(former, tags_of_lights(links=False))]])


def _leave_edit_mode(context: Any) -> None:
    """Undo in edit mode knows the edited meshes alone, and links are stored on objects."""
    if context.mode == "EDIT_MESH":
        bpy.ops.object.mode_set(mode="OBJECT")


def linked_text(linked: Linked) -> str:
    """A sentence with counts for who has linked."""
    verb = _verb("leave", linked.lights)
    return f"{lights_text(linked.lights)} {verb} out {_objects(linked.receivers)}{_more(linked)}"


def unlinked_text(unlinked: Linked) -> str:
    """A sentence with counts for who has unlinked."""
    where = _objects(unlinked.receivers) if unlinked.receivers else "everything"
    return f"{lights_text(unlinked.lights)} {_verb('light', unlinked.lights)} {where} again{_more(unlinked)}"


def _verb(verb: str, count: int) -> str:
    return f"{verb}s" if count == 1 else verb


def _objects(count: int) -> str:
    return "1 object" if count == 1 else f"{count:,} objects"


def _more(linked: Linked) -> str:
    """Of what else carries the same tag ids."""
    more = [lights_text(linked.more_lights)] if linked.more_lights else []
    more += [_objects(linked.more_receivers)] if linked.more_receivers else []
    return f"; so it is for {' and '.join(more)} of the same tags" if more else ""


@dataclass(frozen=True)
class _Lights:
    """Chosen faces of one mesh. mesh: its name. thing: an object that shows it. faces: (n,) bool. tags: of the chosen
    ones, each id once."""

    mesh: str
    thing: Any
    faces: Bool
    tags: Int32


def _chosen_lights(context: Any) -> list[_Lights]:
    found: dict[str, _Lights] = {}
    for thing in chosen_light_meshes(context):
        require_editable(thing)
        faces = chosen_faces(thing)
        if faces.any() and thing.data.name_full not in found:
            tags = np.unique(read_faces(thing, TAG_ATTRIBUTE)[faces])
            found[thing.data.name_full] = _Lights(thing.data.name_full, thing, faces, tags)
    if not found:
        raise InvalidInput("receiver links", "no light is chosen", "select a light mesh, or faces of one in Edit Mode")
    return list(found.values())


def _needs_tag(thing: Any) -> bool:
    """Whether some of what the object shows has no tag id."""
    if whole_number(thing, TAG_PROPERTY) != UNTAGGED:
        return False
    if thing.type != "MESH" or thing.is_instancer or len(thing.modifiers):
        return True
    return bool((read_faces(thing, TAG_ATTRIBUTE) == UNTAGGED).any())


def _receiver_tags(thing: Any, shown: Shown) -> Iterator[int]:
    """Of a visible object, and of what it instances."""
    yield from tags_of(thing).tolist()
    for each in shown.get(thing.name, {}).values():
        yield from tags_of(each).tolist()
    if thing.instance_type == "COLLECTION" and thing.instance_collection is not None:
        for each in thing.instance_collection.all_objects:
            if not is_light_mesh(each):
                yield from _receiver_tags(each, {})


def _own(ids: dict[str, int], name: str) -> list[int]:
    return [ids[name]] if name in ids else []


def _with_new(tags: Int32, number: int | None) -> list[int]:
    return [tag for tag in tags.tolist() if tag != UNTAGGED] + ([] if number is None else [number])


def _products(light_tags: list[int], receiver_tags: npt.NDArray[Any]) -> list[tuple[int, int]]:
    return [(light, int(receiver)) for light in light_tags for receiver in receiver_tags]


def _told(context: Any, count: int, chosen: list[_Lights], receivers: Sequence[Any], pairs: npt.NDArray[Any]) -> Linked:
    """What to tell of `count` changes to `pairs`."""
    chosen_meshes = {each.mesh: each.faces for each in chosen}
    lights = more_lights = 0
    for thing in {each.data.name_full: each for each in light_meshes(context.scene)}.values():
        faces = chosen_meshes.get(thing.data.name_full)
        faces = np.zeros(len(read_faces(thing, TAG_ATTRIBUTE)), bool) if faces is None else faces
        same = np.isin(read_faces(thing, TAG_ATTRIBUTE), pairs[:, 0])
        lights, more_lights = lights + int(faces.sum()), more_lights + int((same & ~faces).sum())
    names = {thing.name for thing in receivers}
    others = (thing for thing in context.scene.objects if thing.name not in names and has_geometry(thing))
    more_receivers = sum(bool(np.isin(tags_of(thing), pairs[:, 1]).any()) for thing in others)
    return Linked(count, lights, len(receivers), more_lights, more_receivers)
