# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags found by place: each light with the faces that it stands for, so that these leave it out.

In three steps: Blender's data are read (`read_tagging`), pairs are found without it (`pair`, `pair_thin`;
tag_separation.py: `separate`), and what changes is written (`write_retagged`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.exact_tags import Tags, pair_exactly
from ...core.light_links import make_links
from ...core.light_mesh import VirtualLightMesh, empty_light_mesh
from ...core.mesh_topology import Bool
from ...core.progress import Progress, as_report, part
from ...core.scene import Int32
from ...core.tag_pairs import living_tags, unpaired
from ...core.thin_surface import thin_triangles
from ..interface.availability import has_geometry
from ..light_colors import one_per_mesh
from ..light_faces import read_faces
from ..light_geometry import light_faces_in_world
from ..light_meshes import chosen_light_meshes, is_local, light_meshes, require_editable, sources, unchanged_light_mesh
from ..names import TAG_ATTRIBUTE
from .light_tags import counted, first_unused_tag, unused_automatic_tag, write_tags
from .other_lights import OtherLights, StoredLinks, distributed, read_others
from .region_pairs import RegionPairs, SourceLights, region_pairs
from .source_faces import NO_FACE, SourceFaces, read_source_faces
from .source_tags import require_unchanged, write_face_tags
from .stored_links import read_links, read_paired_links, write_links

# Share of the work that is done when pairs are known and thin surfaces are yet to be.
PAIRS_TIME = 0.6


@dataclass(frozen=True)
class Tagging:
    """Lights and visible faces with their tags.

    names: of the light meshes. lights: the lights of each. light_tags: of all their faces, numbered through. links: of
    each; paired: those of them that pairing has made. source: the visible surface. others: the other light meshes of
    the file. unused: from here on no id is used in the file; unused_given: none that artists give.
    """

    names: tuple[str, ...]
    lights: tuple[SourceLights, ...]
    light_tags: Int32
    links: tuple[Int32, ...]
    paired: tuple[Int32, ...]
    source: SourceFaces
    others: OtherLights
    unused: int
    unused_given: int

    @property
    def all_links(self) -> Int32:
        """Each link holds for all lights of its id, wherever it is stored."""
        return make_links(np.concatenate([self.others.links, *self.links]))

    @property
    def known(self) -> Int32:
        """Ids that lights and links of the file carry, in any order and number."""
        return np.concatenate([self.light_tags, self.all_links.ravel(), self.others.tags]).astype(np.int32)

    def tags(self) -> Tags:
        """What pairing starts from."""
        paired = make_links(np.concatenate([self.others.paired, *self.paired]))
        face_tags = living_tags(self.source.tags, self.known)
        return Tags(self.light_tags, face_tags, self.all_links, paired, self.others.tags)

    def stored(self, light_tags: Int32) -> list[StoredLinks]:
        """Where links are stored: with the light meshes, whose lights have `light_tags` now, and with others."""
        tags = map(np.unique, _by_light_mesh(self, light_tags))
        own = [StoredLinks(*each) for each in zip(self.names, tags, self.links, self.paired, strict=True)]
        return [*own, *self.others.writable]

    def rows_of_triangles(self) -> Int32:
        """(t,) row of each triangle's tag, over all meshes."""
        return np.concatenate([np.zeros(0, np.int32), *self.source.rows])

    def light_mesh_of(self) -> Int32:
        """(n,) which light mesh each light is of."""
        return np.repeat(np.arange(len(self.lights)), [each.faces.count for each in self.lights]).astype(np.int32)


@dataclass(frozen=True)
class Retagged:
    """New tags and links in place of those of `before`; pairs: how many a face leaves out that were lit before.

    elsewhere: links of other light meshes that change.
    """

    before: Tagging
    light_tags: Int32
    face_tags: Int32
    links: tuple[Int32, ...]
    paired: tuple[Int32, ...]
    pairs: int
    elsewhere: tuple[StoredLinks, ...] = ()


def read_tagging(context: Any, things: Sequence[Any], objects: Sequence[Any] = ()) -> Tagging:
    """The light meshes `things` and what they stand for: their sources, or all that is visible where none is known.

    objects: where given, no surface of others counts. Raises InvalidInput where a light mesh cannot be changed.
    """
    depsgraph = context.evaluated_depsgraph_get()
    for thing in things:
        require_editable(thing)
    faces = [light_faces_in_world(thing, depsgraph) for thing in things]
    tags = [read_faces(thing, TAG_ATTRIBUTE) for thing in things]
    known = [_source_names(thing, context.scene) for thing in things]
    source = read_source_faces()
    wanted = {thing.name for thing in objects}
    lights = []
    for each, names in zip(faces, known, strict=True):
        meshes = (
            index
            for index, owners in enumerate(source.owners)
            if (not names or names & set(owners)) and (not wanted or wanted & set(owners))
        )
        lights.append(SourceLights(each, frozenset(meshes)))
    return Tagging(
        names=tuple(thing.name for thing in things),
        lights=tuple(lights),
        light_tags=np.concatenate([np.zeros(0, np.int32), *tags]),
        links=tuple(read_links(thing) for thing in things),
        paired=tuple(read_paired_links(thing) for thing in things),
        source=source,
        others=read_others(context.scene, things),
        unused=unused_automatic_tag(),
        unused_given=first_unused_tag(),
    )


def chosen_work(context: Any, work: Callable[[Tagging, Progress], Retagged]) -> Callable[[Progress], Retagged]:
    """`work` on the selected light meshes, with the selected visible objects alone if there are any."""
    things = one_per_mesh(chosen_light_meshes(context))
    objects = [thing for thing in context.selected_objects if has_geometry(thing)]
    tagging = read_tagging(context, things, objects)
    return lambda progress: work(tagging, progress)


def scene_work(context: Any, work: Callable[[Tagging, Progress], Retagged]) -> Callable[[Progress], Retagged]:
    """`work` on all light meshes of the scene that belong to this file."""
    things = one_per_mesh([thing for thing in light_meshes(context.scene) if is_local(thing)])
    tagging = read_tagging(context, things)
    return lambda progress: work(tagging, progress)


def _source_names(thing: Any, scene: Any) -> set[str]:
    return {each.name for each in sources(thing, scene) if each is not None}


def pair(tagging: Tagging, progress: Progress) -> Retagged:
    """Every light leaves out the faces that it stands for. Raises Cancelled, and InvalidInput for too many links."""
    return _paired(tagging, region_pairs(tagging.lights, tagging.source.snapshot.meshes, progress), None)


def pair_thin(tagging: Tagging, progress: Progress) -> Retagged:
    """The same for thin bodies and sheets seen from both sides alone (core/thin_surface.py)."""
    meshes = tagging.source.snapshot.meshes
    pairs = region_pairs(tagging.lights, meshes, part(progress, 0.0, PAIRS_TIME))
    thin = as_report(part(progress, PAIRS_TIME, 1.0), "looking for thin surfaces")
    found = thin_triangles(meshes, _as_light_mesh(tagging.lights), pairs.nearest, thin)
    needed = [thin | seen for thin, seen in zip(found.thin, found.two_sided, strict=True)]
    return _paired(tagging, pairs, np.concatenate([np.zeros(0, bool), *needed]))


def pair_lights(tagging: Tagging, chosen: Bool, progress: Progress) -> Retagged:
    """The same for the lights of `chosen`, (n,) bool over all light meshes, alone."""
    pairs = region_pairs(tagging.lights, tagging.source.snapshot.meshes, progress)
    wanted = chosen[pairs.lights]
    return _paired(tagging, replace(pairs, lights=pairs.lights[wanted], triangles=pairs.triangles[wanted]), None)


def _paired(tagging: Tagging, pairs: RegionPairs, needed: Bool | None) -> Retagged:
    tagging = replace(tagging, source=tagging.source.by_face())
    rows = tagging.rows_of_triangles()[pairs.triangles]
    kept = rows != NO_FACE
    if needed is not None:
        kept &= needed[pairs.triangles]
    lights, faces = pairs.lights[kept], rows[kept].astype(np.int64)
    known = tagging.tags()
    lit = unpaired(lights, faces, known.light_tags, known.face_tags, known.links)
    missing = len(np.unique(np.stack([lights[lit], faces[lit]], axis=1), axis=0))
    found = pair_exactly(lights, faces, known, tagging.unused, tagging.source.groups)
    stored = distributed(tagging.stored(found.light_tags), known.links, found.links, found.paired)
    own, others = stored[: len(tagging.names)], stored[len(tagging.names) :]
    changed = (new for new, old in zip(others, tagging.others.writable, strict=True) if len(new.links) > len(old.links))
    links, paired = tuple(each.links for each in own), tuple(each.paired for each in own)
    return Retagged(tagging, found.light_tags, found.face_tags, links, paired, missing, tuple(changed))


def _by_light_mesh(tagging: Tagging, light_tags: Int32) -> list[Int32]:
    ends = np.cumsum([each.faces.count for each in tagging.lights])
    return np.split(light_tags, ends[:-1]) if len(ends) else []


def _as_light_mesh(lights: Sequence[SourceLights]) -> VirtualLightMesh:
    """The corners of all lights, which is all that looking for thin bodies needs."""
    corners = np.concatenate([np.zeros((0, 3, 3)), *(each.faces.corners for each in lights)])
    triangles = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return replace(empty_light_mesh(), vertices=corners.reshape(-1, 3), triangles=triangles)


@dataclass(frozen=True)
class Written:
    """How many lights, faces and objects as a whole got another tag, and how many links there are more."""

    lights: int
    faces: int
    objects: int
    links: int


def write_retagged(context: Any, made: Retagged) -> Written:
    """Write new tags and links. Raises InvalidInput where something changed since; nothing is changed then."""
    before = made.before
    light_tags = _by_light_mesh(before, made.light_tags)
    things = [
        unchanged_light_mesh(context.scene, name, len(tags), "its lights were paired", "pair them again")
        for name, tags in zip(before.names, light_tags, strict=True)
    ]
    require_unchanged(before.source, made.face_tags)
    changed = [context.scene.objects.get(each.name) for each in made.elsewhere]
    for thing, tags, links, paired in zip(things, light_tags, made.links, made.paired, strict=True):
        write_tags(thing, tags)
        write_links(thing, links, paired)
    for thing, each in zip(changed, made.elsewhere, strict=True):
        if thing is not None:
            write_links(thing, each.links, each.paired)
    faces, objects = write_face_tags(before.source, made.face_tags)
    return Written(
        lights=int((made.light_tags != before.light_tags).sum()),
        faces=faces,
        objects=objects,
        links=sum(map(len, made.links)) - sum(map(len, before.links)),
    )


def paired_text(made: Retagged, written: Written) -> str:
    """A sentence with counts."""
    source = made.before.source
    parts = [counted(written.lights, "light"), counted(written.faces, "face"), counted(written.objects, "whole object")]
    changed = ", ".join(part for part in parts if part)
    if changed or written.links:
        pairs = counted(made.pairs, "pair") or "no pair"
        told = f"{changed or 'Nothing'} got tags for {pairs} of light and face; {written.links:+,} links"
    else:
        told = "Nothing to tag: no face that needs it is lit by a light that stands for it"
    for names, why in (
        (source.as_wholes, "as a whole, for lack of faces behind its modifiers"),
        (source.read_only, "left out, since it is linked from another file"),
    ):
        if names:
            told += f"; {names[0]!r}{f' and {len(names) - 1} more' if len(names) > 1 else ''} {why}"
    return told
