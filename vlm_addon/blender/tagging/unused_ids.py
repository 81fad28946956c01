# SPDX-License-Identifier: GPL-3.0-or-later
"""Ids that lights or surfaces carry for links that are gone are taken away: later pairing would join what has them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...core.scene import UNTAGGED, Int32
from ...core.tag_pairs import is_automatic
from ..light_faces import read_faces
from ..light_meshes import is_local, tags_of
from ..names import TAG_ATTRIBUTE, TAG_PROPERTY, is_light_mesh
from ..stored_values import remove_value
from .light_tags import tags_of_lights, write_tags
from .stored_links import read_links


def forget_unused(gone: Int32) -> None:
    """Take the ids of the links `gone`, (k, 2), away from lights that they have no effect on any more, and from
    surfaces that no light leaves out by them. Those of pairing stay."""
    if not len(gone):
        return
    things = list(bpy.data.objects)
    surfaces = [thing for thing in things if not is_light_mesh(thing)]
    lights = [thing for thing in things if is_light_mesh(thing) and thing.type == "MESH"]
    linked = np.concatenate([np.zeros(0, np.int32), *(read_links(thing).ravel() for thing in lights)])
    given = gone[~is_automatic(gone).any(axis=1)]
    visible = np.concatenate([np.zeros(0, np.int32), *map(tags_of, surfaces)])
    of_lights = tags_of_lights(links=False)
    for thing in lights:
        _forget_faces(thing, np.setdiff1d(given[:, 0], np.concatenate([linked, visible])))
    received = np.setdiff1d(given[:, 1], np.concatenate([linked, of_lights]))
    for thing in surfaces:
        if thing.library is None and thing.override_library is None and thing.get(TAG_PROPERTY, UNTAGGED) in received:
            remove_value(thing, TAG_PROPERTY)
        if thing.type == "MESH":
            _forget_faces(thing, received)


def _forget_faces(thing: Any, ids: Int32) -> None:
    if len(ids) and is_local(thing):
        tags = read_faces(thing, TAG_ATTRIBUTE)
        write_tags(thing, np.where(np.isin(tags, ids), UNTAGGED, tags).astype(np.int32))
