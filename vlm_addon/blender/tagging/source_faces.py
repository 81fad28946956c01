# SPDX-License-Identifier: GPL-3.0-or-later
"""Which stored face of which visible object each evaluated triangle comes from, so that tags can be written there.

For one evaluation every face of every mesh carries its own number as its tag: modifiers and instances hand tags on,
so the number on a triangle leads back to the face. What comes out of a modifier that drops attributes (Remesh, a
voxel boolean) and what is no mesh (curves, text) counts as one face: the object's own tag stands for all of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...core.mesh_topology import Int64
from ...core.scene import UNTAGGED, Int32, SceneSnapshot
from ..extraction.extract import ExtractOptions, extract_scene
from ..light_faces import face_count, read_faces, write_faces
from ..names import TAG_ATTRIBUTE, TAG_PROPERTY, is_light_mesh
from ..stored_values import whole_number

NO_FACE = -1


@dataclass(frozen=True)
class TagPlace:
    """Where tags of visible surfaces are stored: the faces of a mesh (`of_mesh`), or an object as a whole.

    name: of an object that has the mesh, or of the object. key: the same for all objects that share the mesh.
    first: its first row among all places; count: its faces, 1 for an object.
    """

    name: str
    key: str
    of_mesh: bool
    first: int
    count: int


@dataclass(frozen=True)
class SourceFaces:
    """The visible surface, triangle by triangle, with where the tag of each is stored.

    snapshot: with the tags that the file has. owners: for each of its meshes, the names of the object and of what
    instances it. rows: for each mesh, (t,) int32 row of `tags` that decides for each triangle, NO_FACE where it cannot
    be written. tags: (rows,) int32, the present tags. places: where the rows are, in order. read_only: names of objects
    whose tags belong to another file. as_wholes: names of objects of which some triangles lead back to no face.
    face_rows: for each mesh, (t,) int32 row of each triangle's own face where it is known, though the tag of its object
    decides, and all objects that show the face have the same. stored: (rows,) int32, what the file has.
    """

    snapshot: SceneSnapshot
    owners: tuple[tuple[str, ...], ...]
    rows: tuple[Int32, ...]
    tags: Int32
    places: tuple[TagPlace, ...]
    read_only: tuple[str, ...]
    as_wholes: tuple[str, ...]
    face_rows: tuple[Int32, ...]
    stored: Int32

    @property
    def groups(self) -> Int64:
        """(rows,) index into `places` of each row."""
        return np.repeat(np.arange(len(self.places)), [place.count for place in self.places])

    def by_face(self) -> SourceFaces:
        """The same with `face_rows`: what is paired with a face of an object is not to hold for all of the object."""
        tags = self.tags.copy()
        for rows, faces in zip(self.rows, self.face_rows, strict=True):
            tags[faces[faces != NO_FACE]] = self.tags[rows[faces != NO_FACE]]
        return replace(self, rows=self.face_rows, tags=tags)

    def to_store(self, tags: Int32) -> Int32:
        """(rows,) int32 what to store for `tags`: faces whose tag has not changed go on following their object."""
        return np.where(tags == self.tags, self.stored, tags).astype(np.int32)

    def place_of(self, rows: npt.ArrayLike) -> Int64:
        """Index into `places` of each row."""
        ends = [place.first + place.count for place in self.places]
        return np.searchsorted(ends, rows, side="right")


def read_source_faces(options: ExtractOptions | None = None) -> SourceFaces:
    """`extract_scene` with the stored face of each triangle. Raises InvalidInput."""
    places = _places()
    tags = _present_tags(places)
    with _faces_numbered(places):
        numbered = extract_scene(options)
    wholes = {place.name: place.first for place in places if not place.of_mesh}
    owners = tuple(owners_of(mesh.name) for mesh in numbered.meshes)
    rows: list[Int32] = []
    known: list[Int32] = []
    read_only: set[str] = set()
    as_wholes: set[str] = set()
    for mesh, names in zip(numbered.meshes, owners, strict=True):
        local = _has_local_faces(names[0])
        found = mesh.tag_ids - 1 if local else np.full(len(mesh.tag_ids), NO_FACE, np.int32)
        if (found == NO_FACE).any():
            (as_wholes if names[0] in wholes else read_only).add(names[0])
        known.append(found.astype(np.int32))
        rows.append(_deciding_rows(found, [wholes[name] for name in names if name in wholes], tags))
    meshes = tuple(
        replace(mesh, tag_ids=np.append(tags, np.int32(UNTAGGED))[each])  # NO_FACE is the last row
        for mesh, each in zip(numbered.meshes, rows, strict=True)
    )
    snapshot = replace(numbered, meshes=meshes)
    unwritten, whole = tuple(sorted(read_only)), tuple(sorted(as_wholes))
    face_rows = _face_rows(known, rows, tags, _hidden_tags(places, {names[0] for names in owners}))
    return SourceFaces(snapshot, owners, tuple(rows), tags, places, unwritten, whole, face_rows, tags)


def _face_rows(
    known: Sequence[Int32], rows: Sequence[Int32], tags: Int32, hidden: Sequence[tuple[slice, int]]
) -> tuple[Int32, ...]:
    """The face of each triangle where it has one and the same tag wherever it is shown, else what decides.

    hidden: rows of faces that some object besides has, and its tag.
    """
    low, high = np.full(len(tags), np.iinfo(np.int32).max), np.full(len(tags), UNTAGGED)
    for faces, deciding in zip(known, rows, strict=True):
        found = faces != NO_FACE
        np.minimum.at(low, faces[found], tags[deciding[found]])
        np.maximum.at(high, faces[found], tags[deciding[found]])
    for at, tag in hidden:
        follows = tags[at] == UNTAGGED
        low[at] = np.where(follows, np.minimum(low[at], tag), low[at])
        high[at] = np.where(follows, np.maximum(high[at], tag), high[at])
    alike = np.append(low == high, False)  # NO_FACE is the last row
    return tuple(np.where(alike[faces], faces, deciding) for faces, deciding in zip(known, rows, strict=True))


def _hidden_tags(places: Sequence[TagPlace], shown: set[str]) -> list[tuple[slice, int]]:
    """For each object that is not `shown`: the rows of its mesh's faces, and its tag as a whole."""
    at = {place.key: slice(place.first, place.first + place.count) for place in places if place.of_mesh}
    hidden = (thing for thing in bpy.data.objects if thing.type == "MESH" and thing.name not in shown)
    return [
        (at[thing.data.name_full], whole_number(thing, TAG_PROPERTY)) for thing in hidden if thing.data.name_full in at
    ]


def _deciding_rows(faces: Int32, wholes: Sequence[int], tags: Int32) -> Int32:
    """Of each triangle: its face, or what is tagged as a whole where the face is not, or is not known.

    wholes: rows of the object and of what instances it, as far as they can be written.
    """
    if not wholes:
        return faces.astype(np.int32)
    tagged = [row for row in wholes if tags[row] != UNTAGGED]
    whole = (tagged or wholes)[0]
    falls_back = faces == NO_FACE
    if tagged:
        falls_back |= tags[faces] == UNTAGGED
    return np.where(falls_back, whole, faces).astype(np.int32)


def _places() -> tuple[TagPlace, ...]:
    """All places of the file that can be written, meshes before objects."""
    things = [thing for thing in bpy.data.objects if not is_light_mesh(thing) and _is_own(thing)]
    meshes = {thing.data.name_full: thing for thing in things if thing.type == "MESH" and _is_own(thing.data)}
    kept = [(thing.name, key, True, face_count(thing)) for key, thing in meshes.items()]
    kept += [(thing.name, thing.name_full, False, 1) for thing in things]
    firsts = np.cumsum([0, *(count for *_, count in kept)]).tolist()
    return tuple(
        TagPlace(name, key, of_mesh, first, count)
        for (name, key, of_mesh, count), first in zip(kept, firsts, strict=False)
    )


def _is_own(block: Any) -> bool:
    return block.library is None and block.override_library is None


def _has_local_faces(name: str) -> bool:
    thing = bpy.data.objects.get((name, None))
    return thing is not None and (thing.data is None or _is_own(thing.data))


def _present_tags(places: Sequence[TagPlace]) -> Int32:
    parts = [np.zeros(0, np.int32)]
    for place in places:
        thing = bpy.data.objects[place.name, None]
        whole = [whole_number(thing, TAG_PROPERTY)]
        parts.append(read_faces(thing, TAG_ATTRIBUTE) if place.of_mesh else np.array(whole, np.int32))
    return np.concatenate(parts)


@contextmanager
def _faces_numbered(places: Sequence[TagPlace]) -> Iterator[None]:
    """Each face has 1 + its row as tag, no object has one; afterwards all is as before."""
    with ExitStack() as stack:
        for place in places:
            thing = bpy.data.objects[place.name, None]
            if place.of_mesh:
                stack.enter_context(_tags_replaced(thing, place.first + 1 + np.arange(place.count, dtype=np.int32)))
            elif TAG_PROPERTY in thing:
                stack.callback(thing.__setitem__, TAG_PROPERTY, thing[TAG_PROPERTY])
                thing[TAG_PROPERTY] = UNTAGGED
        yield


@contextmanager
def _tags_replaced(thing: Any, tags: Int32) -> Iterator[None]:
    attributes = thing.data.attributes
    existed, active = TAG_ATTRIBUTE in attributes, attributes.active_index
    before = read_faces(thing, TAG_ATTRIBUTE)
    write_faces(thing, TAG_ATTRIBUTE, tags)
    try:
        yield
    finally:
        if existed:
            write_faces(thing, TAG_ATTRIBUTE, before)
        else:
            attributes.remove(attributes[TAG_ATTRIBUTE])
        attributes.active_index = active


def owners_of(name: str) -> tuple[str, ...]:
    """Names of the object, and of what instances it, that a mesh of a snapshot is named after (extract.py)."""
    if bpy.data.objects.get(name) is not None:
        return (name,)
    head = name.rpartition("/")[0]
    for at in (place for place, letter in enumerate(head) if letter == "/"):
        parent, instanced = head[:at], head[at + 1 :]
        if bpy.data.objects.get(parent) is not None and bpy.data.objects.get(instanced) is not None:
            return instanced, parent
    return (name,)
