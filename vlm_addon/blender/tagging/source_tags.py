# SPDX-License-Identifier: GPL-3.0-or-later
"""New tags of visible surfaces into the file, where source_faces.py has found them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import numpy as np

from ...core.errors import InvalidInput
from ...core.scene import UNTAGGED, Int32
from ...core.tag_pairs import SurfaceFaces, living_tags
from ..light_faces import face_count
from ..light_meshes import is_local
from ..names import TAG_PROPERTY
from .light_tags import tags_of_lights, unused_automatic_tag, write_tags
from .source_faces import SourceFaces, TagPlace


def faces_to_tag(source: SourceFaces, replaced: Any, kept: Sequence[Int32]) -> SurfaceFaces:
    """What making lights needs to know to tag the faces that they stand for.

    replaced: the light mesh object that they will take the place of, or None; faces forget what was paired with it.
    kept: arrays of ids that it keeps. Raises InvalidInput without unused ids.
    """
    known = np.concatenate([tags_of_lights(replaced), *(np.ravel(tags) for tags in kept)])
    return SurfaceFaces(source.rows, living_tags(source.tags, known), source.groups, unused_automatic_tag())


def require_unchanged(source: SourceFaces, tags: Int32) -> None:
    """Raises InvalidInput where something that would get other tags is gone or has other faces than it had."""
    for place in _changed(source, tags):
        thing = bpy.data.objects.get((place.name, None))
        if thing is None or (place.of_mesh and (not is_local(thing) or face_count(thing) != place.count)):
            raise InvalidInput(f"object {place.name!r}", "it was changed while lights were paired", "pair them again")


def write_face_tags(source: SourceFaces, tags: Int32) -> tuple[int, int]:
    """Write `tags`, a row for each of `source.tags`; returns how many faces and how many whole objects changed."""
    faces = objects = 0
    for place in _changed(source, tags):
        thing = bpy.data.objects[place.name, None]
        rows = slice(place.first, place.first + place.count)
        if place.of_mesh:
            write_tags(thing, tags[rows])
            faces += int((tags[rows] != source.tags[rows]).sum())
            continue
        objects += 1
        if tags[place.first] == UNTAGGED:
            del thing[TAG_PROPERTY]
        else:
            thing[TAG_PROPERTY] = int(tags[place.first])
        thing.update_tag()
    return faces, objects


def _changed(source: SourceFaces, tags: Int32) -> Iterator[TagPlace]:
    for place in source.places:
        rows = slice(place.first, place.first + place.count)
        if not np.array_equal(tags[rows], source.tags[rows]):
            yield place
