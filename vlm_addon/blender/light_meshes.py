# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking up light meshes, what they were made from, and tag ids, by what is stored in the file.

Nothing is remembered between calls, so undo, renaming, duplicating, appending, linking and deleting cannot make an
answer stale. Sources are known by a number (`vlm_id`) that goes with the object through renames; where copies of an
object share it, source_copies.py decides; where the object is linked and could not be given one, its name.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Container, Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..core.errors import InvalidInput
from ..core.scene import UNTAGGED
from .light_faces import face_count, read_faces
from .names import (
    ID_PROPERTY,
    SCHEMA_PROPERTY,
    SCHEMA_VERSION,
    SOURCE_IDS_PROPERTY,
    SOURCE_PLACES_PROPERTY,
    SOURCES_PROPERTY,
    TAG_ATTRIBUTE,
    TAG_PROPERTY,
    is_light_mesh,
)
from .source_copies import PLACE_SIZE, Place, place_of, right_copy, stored_places
from .stored_values import text, whole_number, whole_numbers

NO_ID = 0
LARGEST_ID = 2**31 - 1


def light_meshes(scene: Any) -> list[Any]:
    """The light mesh objects of `scene`, in order of name."""
    found = (thing for thing in scene.objects if thing.type == "MESH" and is_light_mesh(thing))
    return sorted(found, key=lambda thing: thing.name)


def chosen_light_meshes(context: Any) -> list[Any]:
    """The light meshes that a tool works on: those in edit mode, or the selected ones."""
    if context.mode == "EDIT_MESH":
        things = list(context.objects_in_mode_unique_data)
    else:
        things = list(context.selected_objects)
    return sorted((thing for thing in things if is_light_mesh(thing)), key=lambda thing: thing.name)


def set_sources(thing: Any, names: Sequence[str], scene: Any) -> None:
    """Remember the objects of `scene` that the light mesh was made from, and where they stand now; those that can be
    written get an id, and the light mesh gets one of its own."""
    found = [scene.objects.get(name) for name in names]
    counts = _id_counts()
    ids = [NO_ID if source is None else ensure_id(source, counts) for source in found]
    ensure_id(thing, counts)
    lines = [name.replace("\n", " ") for name in names]
    thing[SOURCES_PROPERTY], thing[SOURCE_IDS_PROPERTY] = "\n".join(lines), ids
    _store_places(thing, found)


def add_sources(thing: Any, names: Sequence[str], scene: Any) -> None:
    """Remember more objects of `scene`; where the others stood when the light mesh was made stays known."""
    known = sources(thing, scene)
    before = stored_places(thing, len(known))
    now = [name if source is None else source.name for name, source in zip(source_names(thing), known, strict=True)]
    new = [name for name in names if name not in now and name in scene.objects]
    if not new:
        return
    set_sources(thing, [*now, *new], scene)
    places = stored_places(thing, len(source_names(thing)))
    thing[SOURCE_PLACES_PROPERTY] = np.concatenate([*before, *places[len(before) :]]).tolist()


def keep_places(thing: Any, scene: Any) -> None:
    """The light mesh and its sources stand to each other as they should, though its own origin is elsewhere now."""
    if SOURCES_PROPERTY in thing:
        _store_places(thing, sources(thing, scene))


def _store_places(thing: Any, found: Sequence[Any | None]) -> None:
    places = [np.zeros(PLACE_SIZE) if source is None else place_of(source, thing) for source in found]
    thing[SOURCE_PLACES_PROPERTY] = np.concatenate([np.zeros(0), *places]).tolist()


def source_names(thing: Any) -> list[str]:
    """The names that the sources had when the light mesh was made, none where it was drawn by hand.

    Raises InvalidInput where they cannot be read, as all that looks up sources does.
    """
    return [name for name in text(thing, SOURCES_PROPERTY).split("\n") if name]


def sources(thing: Any, scene: Any) -> list[Any | None]:
    """The objects of `scene` that the light mesh was made from, None for each that is gone."""
    names = source_names(thing)
    ids = whole_numbers(thing, SOURCE_IDS_PROPERTY).tolist()
    ids += [NO_ID] * (len(names) - len(ids))
    known: dict[int, list[Any]] = {}
    for each in scene.objects:
        if (number := _id_of(each)) != NO_ID and not is_light_mesh(each):
            known.setdefault(number, []).append(each)
    rows = zip(names, ids, stored_places(thing, len(names)), strict=False)
    return [_source(thing, name, known.get(number, []), place, scene) for name, number, place in rows]


def _source(thing: Any, name: str, same_id: list[Any], place: Place, scene: Any) -> Any | None:
    if len(same_id) == 1:
        return same_id[0]
    if same_id:
        return right_copy(same_id, name, place, thing, _twins(thing, scene))
    by_name = scene.objects.get(name)
    # An object of that name with another id is another object.
    return by_name if by_name is not None and not is_light_mesh(by_name) and _id_of(by_name) == NO_ID else None


def _twins(thing: Any, scene: Any) -> list[Any]:
    """The light mesh and the copies of it that know no other sources, in order of name."""
    if ID_PROPERTY not in thing:
        return [thing]
    keys = (ID_PROPERTY, SOURCES_PROPERTY)
    return [each for each in light_meshes(scene) if all(each.get(key) == thing.get(key) for key in keys)]


def light_meshes_of(source: Any, scene: Any) -> list[Any]:
    """The light meshes of `scene` that were made from the object `source`."""
    return [thing for thing in light_meshes(scene) if source in sources(thing, scene)]


def ensure_id(thing: Any, counts: Counter[int] | None = None) -> int:
    """The id that this object alone has; NO_ID where it has none and is linked, so that it cannot be written.

    Copies share the id of their original until a light mesh is made of one of them: it gets one of its own then, and
    light meshes that took it for their source learn it. The same file gives the same ids: they come from names.
    counts: how many objects have each id, for callers that ask for many; it is kept up to date.
    """
    counts = _id_counts() if counts is None else counts
    if not is_local(thing):
        return _id_of(thing)
    shared = _id_of(thing)
    if counts[shared] == 1:
        return shared
    known = _references(thing) if shared != NO_ID else []
    number = unused_id(thing.name, counts)
    thing[ID_PROPERTY] = number
    counts.subtract([shared])
    counts[number] += 1
    for light_mesh, index in known:
        ids = whole_numbers(light_mesh, SOURCE_IDS_PROPERTY).tolist()
        ids[index] = number
        light_mesh[SOURCE_IDS_PROPERTY] = ids
    return number


def _id_counts() -> Counter[int]:
    return Counter(number for each in bpy.data.objects if (number := _id_of(each)) != NO_ID)


def _id_of(thing: Any) -> int:
    """NO_ID also where somebody has put something else there: ids are ours to give."""
    try:
        return whole_number(thing, ID_PROPERTY, NO_ID)
    except InvalidInput:
        return NO_ID


def _references(thing: Any) -> list[tuple[Any, int]]:
    """(light mesh, which of its sources) wherever a light mesh of this file knows `thing` by id."""
    return [
        (light_mesh, index)
        for scene in bpy.data.scenes
        for light_mesh in light_meshes(scene)
        for index, source in enumerate(readable_sources(light_mesh, scene))
        if source == thing and is_local(light_mesh) and index < len(light_mesh.get(SOURCE_IDS_PROPERTY, ()))
    ]


def readable_sources(light_mesh: Any, scene: Any) -> list[Any | None]:
    """`sources`, none where they cannot be read: what is written for one light mesh does not fail by another."""
    try:
        return sources(light_mesh, scene)
    except InvalidInput:
        return []


def unused_id(name: str, taken: Container[int]) -> int:
    """An id that is not in `taken`, made from `name`."""
    number = zlib.crc32(name.encode()) % LARGEST_ID + 1
    while number in taken:
        number = number % LARGEST_ID + 1
    return number


def is_local(thing: Any) -> bool:
    """Whether an object and its data belong to this file and can be changed."""
    parts = [thing, thing.data] if getattr(thing, "data", None) is not None else [thing]
    return all(part.library is None and part.override_library is None for part in parts)


def require_editable(thing: Any) -> None:
    """Raises InvalidInput where a light mesh cannot be changed: it is linked, overridden or of a later version."""
    subject = f"light mesh {thing.name!r}"
    if not is_local(thing):
        raise InvalidInput(subject, "it is linked from another file", "make it local (Object > Relations > Make Local)")
    version = whole_number(thing, SCHEMA_PROPERTY)
    if version > SCHEMA_VERSION:
        remedy = "open it with the version of the extension that wrote it"
        raise InvalidInput(subject, f"{SCHEMA_PROPERTY} is {version}, not {SCHEMA_VERSION}", remedy)


def unchanged_light_mesh(scene: Any, name: str, count: int, doing: str, remedy: str) -> Any:
    """The light mesh of that name, for work that numbered its faces when it had `count` of them.

    doing: what the work was, for the message. Raises InvalidInput where it is gone, has another number of faces or
    cannot be changed.
    """
    thing = scene.objects.get(name)
    if thing is None or not is_light_mesh(thing) or face_count(thing) != count:
        raise InvalidInput(f"light mesh {name!r}", f"it was changed while {doing}", remedy)
    require_editable(thing)
    return thing


def tags_of(thing: Any) -> npt.NDArray[np.int32]:
    """The tag ids that a light mesh or a visible object carries, each once, UNTAGGED left out."""
    found = [whole_number(thing, TAG_PROPERTY)] if not is_light_mesh(thing) else []
    if thing.type == "MESH":
        found += np.unique(read_faces(thing, TAG_ATTRIBUTE)).tolist()
    return np.array(sorted({tag for tag in found if tag != UNTAGGED}), np.int32)
