# SPDX-License-Identifier: GPL-3.0-or-later
"""Tag ids that copies of light meshes and objects share, taken apart (core/tags.py)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.light_links import make_links
from ..core.progress import Progress
from ..core.scene import UNTAGGED, Int32
from ..core.tag_pairs import TagUse, is_automatic, related, unpaired
from ..core.tags import separated_tags
from .tagging.light_tags import counted, require_given
from .tagging.region_pairs import RegionPairs, region_pairs
from .tagging.source_faces import NO_FACE
from .tagging.tag_pairing import Retagged, Tagging, Written


def separate(tagging: Tagging, progress: Progress) -> Retagged:
    """Ids that light meshes or objects share which have nothing to do with each other are taken apart.

    Light mesh and object are related by an id where a light of it stands for a face that leaves it out.
    """
    pairs = region_pairs(tagging.lights, tagging.source.snapshot.meshes, progress)
    light_uses, face_uses, relations = _uses(tagging, pairs)
    # In order of light meshes: of copies, the first keeps its ids.
    uses = [*sorted(light_uses, key=_order), *sorted(face_uses, key=_order)]
    groups = related(uses, relations)
    lights, faces = sorted(light_uses, key=groups.__getitem__), sorted(face_uses, key=groups.__getitem__)
    found = separated_tags(
        [use.tag for use in lights],
        [groups[use] for use in lights],
        [use.tag for use in faces],
        [groups[use] for use in faces],
        tagging.unused,
    )
    given = _as_given([*lights, *faces], [*found.light_tags.tolist(), *found.face_tags.tolist()], tagging)
    new_light = {use: given.get(tag, tag) for use, tag in zip(lights, found.light_tags.tolist(), strict=True)}
    new_face = {use: given.get(tag, tag) for use, tag in zip(faces, found.face_tags.tolist(), strict=True)}
    light_mesh_of = tagging.light_mesh_of()
    light_tags = [
        new_light.get(TagUse(tag, _lights_owner(owner)), tag)
        for tag, owner in zip(tagging.light_tags.tolist(), light_mesh_of.tolist(), strict=True)
    ]
    place_of = tagging.source.place_of(np.arange(len(tagging.source.tags)))
    face_tags = [
        new_face.get(TagUse(tag, _place_owner(place)), tag)
        for tag, place in zip(tagging.source.tags.tolist(), place_of.tolist(), strict=True)
    ]
    links, paired = (
        tuple(_renamed(each, new_light, number) for number, each in enumerate(parts))
        for parts in (tagging.links, tagging.paired)
    )
    changed = np.array(light_tags, np.int32), np.array(face_tags, np.int32)
    return Retagged(tagging, *changed, links, paired, len(found.repaired))


def _as_given(uses: list[TagUse], tags: list[int], tagging: Tagging) -> dict[int, int]:
    """Ids as artists give them in place of those new ones of `tags` that take the place of such ids: creation forgets
    the others. Raises InvalidInput where there are not so many."""
    new = dict.fromkeys(
        tag for use, tag in zip(uses, tags, strict=True) if tag >= tagging.unused and not is_automatic(use.tag)
    )
    require_given(tagging.unused_given + len(new) - 1)
    return {tag: tagging.unused_given + number for number, tag in enumerate(new)}


def _order(use: TagUse) -> tuple[int, int]:
    return use.owner[1], use.tag


def _lights_owner(number: int) -> tuple[str, int]:
    return "lights", number


def _place_owner(number: int) -> tuple[str, int]:
    return "place", number


def _uses(tagging: Tagging, pairs: RegionPairs) -> tuple[set[TagUse], set[TagUse], list[tuple[TagUse, TagUse]]]:
    """Uses of ids by lights and by faces, and which of them belong together.

    A linked pair is one of both ids: the lights carry the id of the faces, too, and the other way round.
    """
    light_mesh_of, tags = tagging.light_mesh_of(), tagging.source.tags
    rows = tagging.rows_of_triangles()[pairs.triangles]
    known = rows != NO_FACE
    lights, faces = pairs.lights[known], rows[known].astype(np.int64)
    out = ~unpaired(lights, faces, tagging.light_tags, tags, tagging.all_links)
    lights, faces = lights[out], faces[out]
    places = tagging.source.place_of(faces)
    joined = np.stack([tagging.light_tags[lights], light_mesh_of[lights], tags[faces], places], axis=1)
    light_uses = _all_uses(tagging.light_tags, light_mesh_of, _lights_owner)
    places_of_all = tagging.source.place_of(np.arange(len(tags)))
    face_uses = _all_uses(tags, places_of_all, _place_owner)
    relations = []
    for light_tag, light_mesh, face_tag, place in np.unique(joined, axis=0).tolist():
        for tag in {light_tag, face_tag}:
            of_lights, of_faces = TagUse(tag, _lights_owner(light_mesh)), TagUse(tag, _place_owner(place))
            light_uses.add(of_lights)
            face_uses.add(of_faces)
            relations.append((of_lights, of_faces))
    return light_uses, face_uses, relations


def _all_uses(tags: np.ndarray, owners: np.ndarray, name: Any) -> set[TagUse]:
    found = np.unique(np.stack([tags, owners], axis=1)[tags != UNTAGGED], axis=0)
    return {TagUse(tag, name(owner)) for tag, owner in found.tolist()}


def _renamed(links: Int32, new_light: dict[TagUse, int], number: int) -> Int32:
    """Links of one light mesh with the ids that its lights, and what they are linked to, have now."""
    owner = _lights_owner(number)
    pairs = [[new_light.get(TagUse(tag, owner), tag) for tag in link] for link in links.tolist()]
    return make_links(np.array([each for each in pairs if UNTAGGED not in each], np.int64).reshape(-1, 2))


def repaired_text(made: Retagged, written: Written) -> str:
    """A sentence with counts."""
    if not made.pairs:
        return "No tag id is shared by what does not belong together"
    parts = [counted(written.lights, "light"), counted(written.faces, "face"), counted(written.objects, "whole object")]
    changed = ", ".join(part for part in parts if part) or "nothing"
    return f"{counted(made.pairs, 'tag id')} shared: {changed} changed"
