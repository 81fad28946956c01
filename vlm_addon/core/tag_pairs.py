# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags for pairs of a light and a face that it stands for, beside tags that artists have given already.

A face leaves out a light where both carry one tag id, or where the light's id is linked to the face's (seed 002,
section 3.4; tags.py). What carries a tag keeps it; what is missing is added with as little else left out as possible.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .light_links import MOST_LINKS, leaves_out, make_links, no_links
from .mesh_topology import Bool, Int64
from .scene import UNTAGGED, Int32, Mesh
from .tags import RegionTags, region_tags

FIRST_AUTOMATIC = 1 << 20
"""Ids from here on are given by pairing, those below by hand: what was paired can be told from what an artist meant."""


def is_automatic(tags: npt.ArrayLike) -> Bool:
    """Whether ids were given by pairing."""
    return np.asarray(tags) >= FIRST_AUTOMATIC


def given_by_hand(tags: npt.ArrayLike) -> Int32:
    """The ids that artists gave, UNTAGGED in place of those of pairing: these belong to the lights that were paired,
    and another light of them would leave out what they do."""
    return np.where(is_automatic(tags), UNTAGGED, np.asarray(tags)).astype(np.int32)


def living_tags(face_tags: Int32, known: Int32) -> Int32:
    """`face_tags` without ids that pairing gave for lights that are gone: none of `known` any more."""
    dead = is_automatic(face_tags) & ~np.isin(face_tags, known)
    return np.where(dead, UNTAGGED, face_tags).astype(np.int32)


def without_automatic(mesh: Mesh, received: npt.ArrayLike = ()) -> Mesh:
    """The mesh with the tags alone that artists have given: a new light mesh need not keep regions of an old one.

    received: ids of objects that are left out (`exact_tags.only_received`), which are not meant for their own lights.
    """
    forgotten = is_automatic(mesh.tag_ids) | np.isin(mesh.tag_ids, received)
    return replace(mesh, tag_ids=np.where(forgotten, UNTAGGED, mesh.tag_ids).astype(np.int32))


def add_tags(
    lights: npt.ArrayLike,
    faces: npt.ArrayLike,
    light_tags: npt.ArrayLike,
    face_tags: npt.ArrayLike,
    links: Int32,
    first_tag: int,
    group_of_face: npt.ArrayLike | None = None,
) -> RegionTags:
    """Tags and links with which each face leaves out each light that it is paired with.

    lights, faces: (p,) rows of the pairs, in any order and number. light_tags: (n,), face_tags: (f,) int32, kept where
    they are not UNTAGGED. links: (k, 2), kept. first_tag: from here on no id is used. A light without a tag takes that
    of its faces where they all carry the same, else one of its own; a face without a tag takes that of its lights
    where they all carry the same, else one of its own for this set of tags, to which each is linked. Where both carry
    tags already, these are linked. group_of_face: (f,) int, faces that may share a tag where one for each set of lights
    would need more links than there can be; they then leave out more than their own. Raises InvalidInput where even
    that needs too many.
    """
    lights, faces = np.asarray(lights, np.int64), np.asarray(faces, np.int64)
    light_tags, face_tags = np.array(light_tags, np.int32), np.array(face_tags, np.int32)
    take_common_tag(lights, faces, light_tags, face_tags)
    open_ = unpaired(lights, faces, light_tags, face_tags, links)
    lights, faces = lights[open_], faces[open_]
    fresh = np.unique(lights[light_tags[lights] == UNTAGGED])
    light_tags[fresh] = first_tag + np.arange(len(fresh))
    bare = face_tags[faces] == UNTAGGED
    between = np.stack([light_tags[lights[~bare]], face_tags[faces[~bare]]], axis=1)
    known = np.concatenate([np.asarray(links, np.int64).reshape(-1, 2), between])
    known = np.unique(known, axis=0)
    if len(known) > MOST_LINKS:
        problem = (
            f"{len(known):,} links between ids that there are would be needed, at most {MOST_LINKS:,} are possible"
        )
        raise InvalidInput("tags", problem, "clear those of the lights and of what they stand for, then pair them all")
    pairs = np.unique(np.stack([faces[bare], light_tags[lights[bare]]], axis=1), axis=0).astype(np.int64)
    groups = None if group_of_face is None else np.asarray(group_of_face, np.int64)
    added = _tag_faces(pairs, face_tags, groups, first_tag + len(fresh), MOST_LINKS - len(known))
    return RegionTags(light_tags, face_tags, make_links(np.concatenate([known, added])))


def take_common_tag(lights: Int64, faces: Int64, light_tags: Int32, face_tags: Int32) -> None:
    """Give lights without a tag that of their faces, where all of these carry one and the same."""
    low = np.full(len(light_tags), np.iinfo(np.int32).max, np.int64)
    high = np.full(len(light_tags), UNTAGGED, np.int64)
    np.minimum.at(low, lights, face_tags[faces])
    np.maximum.at(high, lights, face_tags[faces])
    same = (low == high) & (high != UNTAGGED) & (light_tags == UNTAGGED)
    light_tags[same] = high[same]


def _tag_faces(pairs: Int64, face_tags: Int32, groups: Int64 | None, first_tag: int, most: int) -> Int64:
    """Tag the faces of `pairs`, (p, 2) of a face without a tag and a tag of its lights, each once, in order of faces.

    Returns the links for it, (k, 2). groups: (f,), see `add_tags`. Raises InvalidInput for more than `most` links.
    """
    rows, first, count = np.unique(pairs[:, 0], return_index=True, return_counts=True)
    face_tags[rows[count == 1]] = pairs[first[count == 1], 1]
    rows, first = rows[count > 1], first[count > 1]
    pairs = pairs[np.isin(pairs[:, 0], rows)]
    if not len(pairs):
        return np.zeros((0, 2), np.int64)
    known, tag = np.unique(pairs[:, 1], return_inverse=True)
    least = np.minimum.reduceat(tag, np.searchsorted(pairs[:, 0], rows))
    for shares in _ways_to_share(rows, least, groups):
        number = shares[np.searchsorted(rows, pairs[:, 0])]
        # region_tags numbers the tags that there are from 1, and sets of them after that.
        found = _within(most, tag, number, len(known))
        if found is not None:
            break
    else:
        problem = f"{len(pairs):,} pairs of a light and a face of several lights need more than {most:,} links"
        raise InvalidInput(
            "tags", problem, "pair fewer objects at a time (select them, too), or Tag Thin Surfaces alone"
        )
    sets = np.arange(max(int(found.face_tags.max()) - len(known), 0))
    names = np.concatenate([[UNTAGGED], known, first_tag + sets])
    face_tags[rows] = names[found.face_tags[shares]]
    return names[found.links].reshape(-1, 2)


def _ways_to_share(rows: Int64, least: Int64, groups: Int64 | None) -> Iterator[Int64]:
    """For each face a number, the same for those that are to share a tag: none, then more and more of a group."""
    yield np.arange(len(rows))
    if groups is not None:
        span = int(least.max()) + 1
        yield np.unique(groups[rows] * span + least, return_inverse=True)[1]
        yield np.unique(groups[rows], return_inverse=True)[1]


def _within(most: int, tag: Int64, number: Int64, tags: int) -> RegionTags | None:
    """Tags of numbered faces, if they need no more than `most` links."""
    pairs = np.unique(np.stack([number, tag], axis=1), axis=0)
    try:
        found = region_tags(pairs[:, 1], pairs[:, 0], 1, tags, int(number.max()) + 1, np.arange(tags))
    except InvalidInput:
        # It has counted its links itself.
        return None
    return found if len(found.links) <= most else None


def unpaired(lights: Int64, faces: Int64, light_tags: Int32, face_tags: Int32, links: Int32) -> Bool:
    """(p,) whether the face of each pair is still lit by the light of the pair."""
    return ~leaves_out(links, light_tags[lights], face_tags[faces])


@dataclass(frozen=True)
class SurfaceFaces:
    """Where the tags of visible triangles are kept. rows: for each mesh, (its triangles,) int32 row of `tags`, -1 for
    none. tags: (f,) int32, the present ones. groups: (f,) int, which thing each row is of. first_tag: from here on no
    id is used. links: (k, 2) int32 that there are; light_tags: ids that lights carry besides."""

    rows: tuple[Int32, ...]
    tags: Int32
    groups: Int64
    first_tag: int
    links: Int32 = field(default_factory=no_links)
    light_tags: Int32 = field(default_factory=lambda: np.zeros(0, np.int32))

    def tagged(self, meshes: Sequence[Mesh], tags: Int32) -> tuple[Mesh, ...]:
        """The meshes as they are with `tags`, (f,) int32, in place of the present ones."""
        known = np.append(tags, np.int32(UNTAGGED))  # the row -1 is the last one
        return tuple(replace(mesh, tag_ids=known[rows]) for mesh, rows in zip(meshes, self.rows, strict=True))


@dataclass(frozen=True)
class TagUse:
    """One owner of lights or faces that carries a tag id, itself or by a link. owner: what it is, and its number."""

    tag: int
    owner: tuple[str, int]


def related(uses: Iterable[TagUse], pairs: Iterable[tuple[TagUse, TagUse]]) -> dict[TagUse, int]:
    """A number for each use, in their order, the same for those that `pairs` connect, directly or over others."""
    parent = {use: use for use in uses}

    def root(use: TagUse) -> TagUse:
        while parent[use] != use:
            parent[use] = parent[parent[use]]
            use = parent[use]
        return use

    for one, other in pairs:
        parent[root(other)] = root(one)
    numbers: dict[TagUse, int] = {}
    return {use: numbers.setdefault(root(use), len(numbers)) for use in parent}
