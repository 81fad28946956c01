# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags that leave out the pairs of a light and a face that are asked for, and besides just what was left out before.

An id that several lights or faces share says what an artist meant for all of them. A pair is about one light and one
face, so a light or face that is paired gets an id of its own, and links by which everything that the shared id left
out is left out still (core/tag_pairs.py; seed 002, section 3.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .light_links import MOST_LINKS, is_link, make_links, no_links
from .light_mesh import VirtualLightMesh
from .mesh_topology import Bool, Int64, rows_by_key
from .scene import UNTAGGED, Int32
from .tag_pairs import SurfaceFaces, is_automatic, take_common_tag, unpaired
from .tags import numbered_sets

MOST_TRIED = 4 * MOST_LINKS
"""Links that are looked at, some of them twice, to see whether they are too many."""


def _no_tags() -> Int32:
    return np.zeros(0, np.int32)


@dataclass(frozen=True)
class Tags:
    """Who carries which tag id, and who leaves out whom besides.

    light_tags: (n,) int32. face_tags: (f,) int32. links: (k, 2) int32, all there are. paired: (p, 2) int32, those of
    them that pairing has made. elsewhere_lights, elsewhere_faces: ids that others carry, of lights and of surfaces.
    """

    light_tags: Int32
    face_tags: Int32
    links: Int32 = field(default_factory=no_links)
    paired: Int32 = field(default_factory=no_links)
    elsewhere_lights: Int32 = field(default_factory=_no_tags)
    elsewhere_faces: Int32 = field(default_factory=_no_tags)


def only_received(links: Int32, light_tags: npt.ArrayLike) -> Int32:
    """Ids that links name as receivers and no light carries: of objects that an artist has had left out, no more."""
    received = np.unique(links[:, 1])
    return np.asarray(received[~np.isin(received, light_tags)], np.int32)


def pair_exactly(
    lights: npt.ArrayLike, faces: npt.ArrayLike, known: Tags, first_tag: int, groups: npt.ArrayLike | None = None
) -> Tags:
    """`known` with tags and links by which each face leaves out each light that it is paired with, and no other besides
    those that it left out before.

    lights, faces: (p,) rows of the pairs. first_tag: from here on no id is used. A light without an id whose faces all
    carry one that an artist gave takes that, and is left out wherever it is; but not one that objects have for being
    left out (`only_received`). groups: (f,) int, faces that may share a new id where one for each set of lights would
    need more links than there can be; they then leave out more than their own. Raises InvalidInput where even that
    needs too many.
    """
    lights, faces = np.asarray(lights, np.int64), np.asarray(faces, np.int64)
    light_tags, face_tags = known.light_tags.astype(np.int32), known.face_tags.astype(np.int32)
    received = only_received(known.links, np.append(light_tags, known.elsewhere_lights))
    given = np.where(is_automatic(face_tags) | np.isin(face_tags, received), UNTAGGED, face_tags).astype(np.int32)
    take_common_tag(lights, faces, light_tags, given)
    open_ = unpaired(lights, faces, light_tags, face_tags, known.links)
    lights, faces = lights[open_], faces[open_]
    links = _Links.of(known)
    fresh, links = _own_light_tags(np.unique(lights), light_tags, known.elsewhere_lights, links, first_tag)
    pairs = np.unique(np.stack([faces, light_tags[lights]], axis=1), axis=0).astype(np.int64)
    for shares, refine in _ways_to_share(pairs, face_tags, groups):
        tags = face_tags.copy()
        made = _tag_faces(pairs, tags, shares, refine, known.elsewhere_faces, links, first_tag + fresh)
        if made is not None:
            break
    else:
        problem = f"{len(pairs):,} pairs of lights and faces need more than {MOST_LINKS:,} links"
        remedy = "pair fewer objects at a time (select them, too), or Tag Thin Surfaces alone"
        raise InvalidInput("tags", problem, remedy)
    joined = make_links(made.pairs)
    return Tags(light_tags, tags, joined, make_links(made.pairs[made.paired]), *_elsewhere(known))


def tagged_by_map(
    light_mesh: VirtualLightMesh, light_of_triangle: Sequence[npt.ArrayLike], faces: SurfaceFaces
) -> tuple[VirtualLightMesh, Tags]:
    """The light mesh with tags and links by which each face leaves out its own lights, and the tags of all.

    light_of_triangle: for each mesh, (its triangles,) int, -1 for none. Raises InvalidInput for too many links.
    """
    lights = np.concatenate([np.zeros(0, np.int64), *(np.asarray(part, np.int64) for part in light_of_triangle)])
    rows = np.concatenate([np.zeros(0, np.int64), *faces.rows])
    kept = (lights >= 0) & (rows >= 0)
    links = make_links(np.concatenate([light_mesh.links, faces.links]))
    known = Tags(light_mesh.tag_ids, faces.tags, links, elsewhere_lights=faces.light_tags)
    found = pair_exactly(lights[kept], rows[kept], known, faces.first_tag, faces.groups)
    # Links of other lights stay with these.
    own = np.isin(found.links[:, 0], found.light_tags) | ~is_link(found.links, faces.links)
    return replace(light_mesh, tag_ids=found.light_tags, links=make_links(found.links[own])), found


def _elsewhere(known: Tags) -> tuple[Int32, Int32]:
    return known.elsewhere_lights, known.elsewhere_faces


@dataclass(frozen=True)
class _Links:
    """pairs: (k, 2) int64 ids of lights and of what they leave out, in any order and number. paired: (k,) bool, those
    that pairing has made."""

    pairs: Int64
    paired: Bool

    @staticmethod
    def of(known: Tags) -> _Links:
        links = known.links.astype(np.int64).reshape(-1, 2)
        return _Links(links, is_link(known.links, known.paired))

    def with_(self, pairs: Int64, paired: npt.ArrayLike) -> _Links:
        paired = np.broadcast_to(np.asarray(paired, bool), len(pairs))
        return _Links(np.concatenate([self.pairs, pairs.reshape(-1, 2)]), np.concatenate([self.paired, paired]))

    def inherited(self, old: Int64, new: Int64, side: int) -> _Links:
        """With links of the ids `new` like those of the ids `old` on one side: 0 of lights, 1 of surfaces.

        What carries an id leaves out, or is left out by, what carries the same: the two ids are linked, too.
        """
        known, place = np.unique(old, return_inverse=True)
        if not len(known):
            return self
        new_of = rows_by_key(place, len(known), new)
        mine = np.flatnonzero(np.isin(self.pairs[:, side], known))
        owner, renamed = new_of.expand(np.searchsorted(known, self.pairs[mine, side]))
        pairs = self.pairs[mine][owner]
        pairs[:, side] = renamed
        own = np.stack([old, new] if side else [new, old], axis=1)
        return self.with_(pairs, self.paired[mine][owner]).with_(own, True)

    def inherited_count(self, old: Int64, side: int) -> int:
        """How many `inherited` adds."""
        ids, count = np.unique(self.pairs[:, side], return_counts=True)
        if not len(ids):
            return len(old)
        place = np.minimum(np.searchsorted(ids, old), len(ids) - 1)
        return len(old) + int(count[place[ids[place] == old]].sum())


def _own_light_tags(
    needed: Int64, light_tags: Int32, elsewhere: Int32, links: _Links, first_tag: int
) -> tuple[int, _Links]:
    """Give the lights `needed` ids that nothing else carries, from `first_tag` on; returns how many, and the links."""
    before = light_tags[needed]
    ids, count = np.unique(light_tags, return_counts=True)
    shared = count[np.searchsorted(ids, before)] > 1
    # Pairing links its own ids alone, so that what it adds can be told from what an artist meant.
    renewed = shared | ~is_automatic(before) | np.isin(before, elsewhere)
    rows, old = needed[renewed], before[renewed].astype(np.int64)
    new = first_tag + np.arange(len(rows))
    light_tags[rows] = new
    meant = old != UNTAGGED
    if links.inherited_count(old[meant], 0) > MOST_LINKS:
        problem = f"{len(rows):,} lights of shared ids would need more than {MOST_LINKS:,} links"
        raise InvalidInput("tags", problem, "clear the ids of lights or of what they leave out, then pair again")
    return len(rows), links.inherited(old[meant], new[meant], 0)


def _ways_to_share(pairs: Int64, face_tags: Int32, groups: npt.ArrayLike | None) -> Iterator[tuple[Int64, bool]]:
    """For each face of `pairs` a number, the same for those that are to share a tag: none, then more and more of a
    group; and whether faces that carry an id get another."""
    rows, first = np.unique(pairs[:, 0], return_index=True)
    yield np.arange(len(rows)), True
    if groups is None or not len(rows):
        return
    group, tag = np.asarray(groups, np.int64)[rows], face_tags[rows]
    least = np.minimum.reduceat(pairs[:, 1], first)
    for keys in ((group, tag, least), (group, tag)):
        yield np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True)[1].ravel(), True
    yield np.unique(np.stack([group, tag], axis=1), axis=0, return_inverse=True)[1].ravel(), False


def _tag_faces(
    pairs: Int64, face_tags: Int32, shares: Int64, refine: bool, elsewhere: Int32, links: _Links, first_tag: int
) -> _Links | None:
    """Tag the faces of `pairs`, (p, 2) of a face and the own id of a light, each once, in order of faces.

    shares, refine: see `_ways_to_share`. Returns all links, None where there would be too many.
    """
    if not len(pairs):
        return links
    rows = np.unique(pairs[:, 0])
    shared = shares[np.searchsorted(rows, pairs[:, 0])]
    wanted = np.unique(np.stack([shared, pairs[:, 1]], axis=1), axis=0)
    ids, member = np.unique(wanted[:, 1], return_inverse=True)
    share, number = numbered_sets(wanted[:, 0], member.ravel(), len(ids))
    set_of_row = number[np.searchsorted(share, shares)]
    before = face_tags[rows].astype(np.int64)
    classes, class_of_row = np.unique(np.stack([before, set_of_row], axis=1), axis=0, return_inverse=True)
    old = classes[:, 0]
    # Any face of a class has the set of all.
    sample = np.zeros(len(classes), np.int64)
    sample[class_of_row.ravel()] = shares
    members = rows_by_key(np.searchsorted(share, wanted[:, 0]), len(share), wanted[:, 1])
    owner, tag = members.expand(np.searchsorted(share, sample))
    alone = np.bincount(owner, minlength=len(classes)) == 1
    first = tag[np.searchsorted(owner, np.arange(len(classes)))]
    # An id that others carry which leave out more from now on would bring that along.
    takes = (old == UNTAGGED) & alone & ~np.isin(first, np.append(links.pairs[:, 1], old))
    keeps = (old != UNTAGGED) & (_is_all(old, class_of_row.ravel(), face_tags, elsewhere) | ~np.bool_(refine))
    fresh = ~takes & ~keeps
    new = np.where(takes, first, old)
    new[fresh] = first_tag + np.arange(int(fresh.sum()))
    renamed = fresh & (old != UNTAGGED)
    linked = ~takes[owner]
    if len(links.pairs) + int(linked.sum()) + links.inherited_count(old[renamed], 1) > MOST_TRIED:
        return None
    made = links.inherited(old[renamed], new[renamed], 1)
    made = made.with_(np.stack([tag, new[owner]], axis=1)[linked], True)
    if len(np.unique(made.pairs, axis=0)) > MOST_LINKS:
        return None
    face_tags[rows] = new[class_of_row.ravel()]
    return made


def _is_all(old: Int64, class_of_row: Int64, face_tags: Int32, elsewhere: Int32) -> Bool:
    """For each class of faces of one id, whether nothing else carries this id."""
    ids, count = np.unique(face_tags, return_counts=True)
    size = np.bincount(class_of_row, minlength=len(old))
    return np.asarray((count[np.searchsorted(ids, old)] == size) & ~np.isin(old, elsewhere))
