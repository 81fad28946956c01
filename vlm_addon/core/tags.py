# SPDX-License-Identifier: GPL-3.0-or-later
"""Tag ids for lights and faces: of the regions that lights stand for, and apart where unrelated things share one.

A surface point leaves out every light of its own tag, and every light linked to it (seed 002, section 3.4). What must
be left out are the lights whose region holds the point (own light), and nothing else: an object lights its other parts.
A face carries one tag, though its triangles may lie in regions of several lights. Faces of one light carry the tag of
that light; faces of several carry a tag of their own for that set of lights, and each of these lights is linked to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .light_links import make_links, no_links
from .mesh_topology import Int64, rows_by_key
from .nearest_lights import light_of_triangles, pair_nearest
from .scene import UNTAGGED, Int32
from .thin_surface import ThinSurface, thin_triangles

__all__ = [
    "RegionTags",
    "SeparatedTags",
    "ThinSurface",
    "light_of_triangles",
    "next_tag",
    "numbered_sets",
    "pair_nearest",
    "region_tags",
    "separated_tags",
    "shared_wrongly",
    "thin_triangles",
]


@dataclass(frozen=True)
class RegionTags:
    """light_tags: (n,) int32. face_tags: (f,) int32, UNTAGGED for faces in no region. links: (k, 2) int32, sorted
    pairs of a light's tag and the tag of faces that leave it out besides their own."""

    light_tags: Int32
    face_tags: Int32
    links: Int32


def region_tags(
    light_of_triangle: npt.ArrayLike,
    face_of_triangle: npt.ArrayLike,
    first_tag: int = 1,
    light_count: int | None = None,
    face_count: int | None = None,
    group_of_light: npt.ArrayLike | None = None,
) -> RegionTags:
    """Tags from `first_tag` on with which every face leaves out the lights of its triangles, and no other.

    light_of_triangle: (t,) int, -1 for none. face_of_triangle: (t,) int, numbered through over all meshes. Counts: as
    many as are named by default. group_of_light: (n,) int, lights of one group share a tag, so a face in the region of
    one leaves out all of them; each for itself by default. Raises InvalidInput where arrays do not fit together.
    """
    lights, faces = _checked(light_of_triangle, face_of_triangle)
    light_count = int(lights.max(initial=-1)) + 1 if light_count is None else light_count
    face_count = int(faces.max(initial=-1)) + 1 if face_count is None else face_count
    group = np.arange(light_count) if group_of_light is None else np.asarray(group_of_light, np.int64)
    if len(group) != light_count or lights.max(initial=-1) >= light_count or faces.max(initial=-1) >= face_count:
        problem = f"{light_count} lights in {len(group)} groups, {face_count} faces"
        raise InvalidInput("region tags", problem, "give the counts of what the triangles name")
    _, group = np.unique(group, return_inverse=True)
    light_tags = (first_tag + group).astype(np.int32)
    held = lights >= 0
    groups = int(group.max(initial=-1)) + 1
    pairs = np.unique(faces[held] * max(groups, 1) + group[lights[held]])
    face, member = pairs // max(groups, 1), pairs % max(groups, 1)
    count = np.bincount(face, minlength=face_count)
    face_tags = np.full(face_count, UNTAGGED, np.int32)
    alone = count[face] == 1
    face_tags[face[alone]] = first_tag + member[alone]
    if alone.all():
        return RegionTags(light_tags, face_tags, no_links())
    face, member = face[~alone], member[~alone]
    shared, number = numbered_sets(face, member, groups)
    face_tags[shared] = first_tag + groups + number
    links = np.stack([first_tag + member, face_tags[face]], axis=1)
    return RegionTags(light_tags, face_tags, make_links(links))


def _checked(light_of_triangle: npt.ArrayLike, face_of_triangle: npt.ArrayLike) -> tuple[Int64, Int64]:
    lights, faces = np.asarray(light_of_triangle, np.int64).ravel(), np.asarray(face_of_triangle, np.int64).ravel()
    if len(lights) != len(faces):
        problem = f"{len(lights)} lights for {len(faces)} faces of triangles"
        raise InvalidInput("region tags", problem, "give one light and one face for each triangle")
    if (faces < 0).any():
        raise InvalidInput("region tags", f"face {faces.min()}", "number faces from 0")
    return lights, faces


def numbered_sets(face: Int64, member: Int64, members: int) -> tuple[Int64, Int64]:
    """(each face once, ascending; the number from 0 of the set of its members). Faces of equal sets share a number.

    Sets are told apart by the sum of a random 64-bit number for each member (Zobrist 1970): of a million sets, two
    different ones agree with a chance of 3e-8; they are compared member by member, so that this cannot matter.
    """
    random = np.random.default_rng(0).integers(0, 2**64, members, np.uint64)
    rows, starts = np.unique(face, return_index=True)
    ends = np.append(starts[1:], len(face))
    key = np.add.reduceat(random[member], starts)
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    length = ends - starts
    like = first[number]
    same = length == length[like]
    owner = np.repeat(np.arange(len(rows)), length)
    place = np.arange(len(face)) - starts[owner]
    compared = same[owner]
    differs = member[compared] != member[starts[like[owner[compared]]] + place[compared]]
    same[owner[compared][differs]] = False
    number[~same] = len(first) + np.arange(int((~same).sum()))
    return rows, number


def next_tag(*tags: npt.ArrayLike) -> int:
    """The least tag id above all that are given, at least 1."""
    return max([0, *(int(np.max(values)) for values in tags if np.size(values))]) + 1


@dataclass(frozen=True)
class SeparatedTags:
    """light_tags: (n,) int32. face_tags: (f,) int32. repaired: (r,) int32, ids that unrelated things shared."""

    light_tags: Int32
    face_tags: Int32
    repaired: Int32


def shared_wrongly(
    light_tags: npt.ArrayLike, light_group: npt.ArrayLike, face_tags: npt.ArrayLike, face_group: npt.ArrayLike
) -> Int32:
    """(r,) int32 ascending: tag ids that lights or faces of several groups carry.

    light_group, face_group: int, equal for a light mesh and the surfaces that it stands for.
    """
    tag = np.concatenate([np.asarray(light_tags, np.int64), np.asarray(face_tags, np.int64)])
    group = np.concatenate([np.asarray(light_group, np.int64), np.asarray(face_group, np.int64)])
    pairs = np.unique(np.stack([tag, group], axis=1)[tag != UNTAGGED], axis=0)
    ids, count = np.unique(pairs[:, 0], return_counts=True)
    return ids[count > 1].astype(np.int32)


def separated_tags(
    light_tags: npt.ArrayLike,
    light_group: npt.ArrayLike,
    face_tags: npt.ArrayLike,
    face_group: npt.ArrayLike,
    first_tag: int,
) -> SeparatedTags:
    """The tags with a new id, from `first_tag` on, for all but one of the groups that share one.

    The group with lights and faces of the id keeps it, of several such the smallest number. Within a group lights and
    faces go on sharing; faces whose group has no light of the id, and lights whose group has no such face, lose the
    tag: it would leave out nothing of their own. Arguments as for `shared_wrongly`.
    """
    light_tags, face_tags = np.array(light_tags, np.int32), np.array(face_tags, np.int32)
    light_group, face_group = np.asarray(light_group, np.int64), np.asarray(face_group, np.int64)
    wrong = shared_wrongly(light_tags, light_group, face_tags, face_group)
    lights_by_tag, faces_by_tag = _by_tag(light_tags, wrong), _by_tag(face_tags, wrong)
    fresh = first_tag
    for row in range(len(wrong)):
        lights, faces = lights_by_tag[row], faces_by_tag[row]
        whole = np.intersect1d(light_group[lights], face_group[faces])
        if not len(whole):
            continue
        for group in whole[1:]:
            light_tags[lights[light_group[lights] == group]] = fresh
            face_tags[faces[face_group[faces] == group]] = fresh
            fresh += 1
        light_tags[lights[~np.isin(light_group[lights], whole)]] = UNTAGGED
        face_tags[faces[~np.isin(face_group[faces], whole)]] = UNTAGGED
    return SeparatedTags(light_tags, face_tags, wrong)


def _by_tag(tags: Int32, wanted: Int32) -> list[Int64]:
    """The rows of each wanted tag."""
    place = np.searchsorted(wanted, tags)
    place = np.minimum(place, max(len(wanted) - 1, 0))
    rows = np.flatnonzero(wanted[place] == tags) if len(wanted) else np.zeros(0, np.int64)
    gathered = rows_by_key(place[rows], len(wanted), rows)
    return [gathered.values[start:end] for start, end in zip(gathered.starts[:-1], gathered.starts[1:], strict=True)]
