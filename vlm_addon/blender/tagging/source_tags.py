# SPDX-License-Identifier: GPL-3.0-or-later
"""New tags of visible surfaces into the file, where source_faces.py has found them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import numpy as np

from ...core.errors import InvalidInput
from ...core.exact_tags import only_received
from ...core.light_links import make_links
from ...core.scene import UNTAGGED, Int32
from ...core.tag_pairs import SurfaceFaces, is_automatic, living_tags
from ..light_faces import face_count
from ..light_meshes import is_local
from ..names import TAG_PROPERTY
from ..stored_values import remove_value, set_value
from .light_tags import tags_of_lights, unused_automatic_tag, write_tags
from .other_lights import read_others
from .source_faces import SourceFaces, TagPlace
from .stored_links import read_links, read_paired_links


def faces_to_tag(source: SourceFaces, scene: Any, replaced: Any, kept: Sequence[Int32]) -> SurfaceFaces:
    """What making lights needs to know to tag the faces that they stand for.

    source: by face. replaced: the light mesh object that they will take the place of, or None; faces forget what was
    paired with it. kept: arrays of ids that it keeps. Raises InvalidInput without unused ids.
    """
    known = np.concatenate([tags_of_lights(replaced), *(np.ravel(tags) for tags in kept)])
    others = read_others(scene, [] if replaced is None else [replaced])
    links, tags = others.links, source.tags
    if replaced is not None:
        tags = _as_before(tags, read_paired_links(replaced), known)
        given = read_links(replaced)
        links = make_links(np.concatenate([links, given[~is_automatic(given).any(axis=1)]]))
    tags = living_tags(tags, known)
    return SurfaceFaces(source.rows, tags, source.groups, unused_automatic_tag(), links, others.tags)


def _as_before(tags: Int32, paired: Int32, known: Int32) -> Int32:
    """Tags with those of artists in place of ids that pairing gave instead, for lights that are gone: such an id is
    linked to from the artist's."""
    memory = paired[~is_automatic(paired[:, 0]) & is_automatic(paired[:, 1]) & ~np.isin(paired[:, 1], known)]
    if not len(memory):
        return tags
    memory = memory[np.argsort(memory[:, 1], kind="stable")]
    place = np.minimum(np.searchsorted(memory[:, 1], tags), len(memory) - 1)
    return np.where(memory[place, 1] == tags, memory[place, 0], tags).astype(np.int32)


def received_tags() -> Int32:
    """Ids of objects that lights of the file leave out, and that no light carries."""
    found = read_others(None, [])
    return only_received(found.links, found.tags)


def require_unchanged(source: SourceFaces, tags: Int32) -> None:
    """Raises InvalidInput where something that would get other tags is gone or has other faces than it had."""
    for place in _changed(source, tags):
        thing = bpy.data.objects.get((place.name, None))
        if thing is None or (place.of_mesh and (not is_local(thing) or face_count(thing) != place.count)):
            raise InvalidInput(f"object {place.name!r}", "it was changed while lights were paired", "pair them again")


def write_face_tags(source: SourceFaces, tags: Int32) -> tuple[int, int]:
    """Write `tags`, a row for each of `source.tags`; returns how many faces and how many whole objects changed."""
    faces = objects = 0
    stored = source.to_store(tags)
    for place in _changed(source, tags):
        thing = bpy.data.objects[place.name, None]
        rows = slice(place.first, place.first + place.count)
        if place.of_mesh:
            write_tags(thing, stored[rows])
            faces += int((stored[rows] != source.stored[rows]).sum())
            continue
        objects += 1
        if stored[place.first] == UNTAGGED:
            remove_value(thing, TAG_PROPERTY)
        else:
            set_value(thing, TAG_PROPERTY, int(stored[place.first]))
    return faces, objects


def _changed(source: SourceFaces, tags: Int32) -> Iterator[TagPlace]:
    stored = source.to_store(tags)
    for place in source.places:
        rows = slice(place.first, place.first + place.count)
        if not np.array_equal(stored[rows], source.stored[rows]):
            yield place
