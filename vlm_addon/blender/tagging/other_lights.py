# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes of the file beside those that are paired: ids that they share, and links that are stored with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...core.light_links import is_link, make_links
from ...core.scene import Int32
from ..light_meshes import is_local, tags_of
from ..names import is_light_mesh
from .stored_links import common_links, read_links, read_paired_links


@dataclass(frozen=True)
class StoredLinks:
    """Links of one light mesh. name: of the object. tags: ids of its lights, each once. links: all of them. paired:
    those that pairing has made."""

    name: str
    tags: Int32
    links: Int32
    paired: Int32


@dataclass(frozen=True)
class OtherLights:
    """tags: ids that lights of others carry. links, paired: all of theirs. writable: those of the scene that can be
    changed."""

    tags: Int32
    links: Int32
    paired: Int32
    writable: tuple[StoredLinks, ...]


def read_others(scene: Any, things: Sequence[Any]) -> OtherLights:
    """All light meshes of the file but `things`; scene: of those that can be written, None for none of them. Raises
    InvalidInput where a property holds no links."""
    meshes = {thing.data.name_full for thing in things}
    found = [each for each in bpy.data.objects if is_light_mesh(each) and each.type == "MESH" and each not in things]
    stored = [StoredLinks(each.name, tags_of(each), read_links(each), read_paired_links(each)) for each in found]
    # An object that shares a mesh with one of `things` shares its tags.
    tags = [each.tags for thing, each in zip(found, stored, strict=True) if thing.data.name_full not in meshes]
    none = make_links([])
    return OtherLights(
        np.concatenate([np.zeros(0, np.int32), *tags]),
        make_links(np.concatenate([none, *(each.links for each in stored)])),
        make_links(np.concatenate([none, *(each.paired for each in stored)])),
        tuple(
            each
            for thing, each in zip(found, stored, strict=True)
            if is_local(thing) and scene is not None and thing.name in scene.objects
        ),
    )


def distributed(before: Sequence[StoredLinks], known: Int32, links: Int32, paired: Int32) -> list[StoredLinks]:
    """`before` with those of `links` that are not `known` yet: each is stored wherever its lights are, or links of
    these; one of no such lights with the first. paired: those of all links that pairing has made."""
    new = links[~is_link(links, known)]
    left = np.ones(len(new), bool)
    found = []
    for each in before:
        own = np.isin(new[:, 0], np.append(each.tags, each.links[:, 0]))
        left &= ~own
        found.append(np.concatenate([each.links, new[own]]))
    if found:
        found[0] = np.concatenate([found[0], new[left]])
    made = [make_links(each) for each in found]
    return [
        StoredLinks(each.name, each.tags, some, common_links(some, paired))
        for each, some in zip(before, made, strict=True)
    ]
