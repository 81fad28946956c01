# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights that an artist has locked, which stay as they are where their light mesh is made anew."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh
from .extraction.color_space import convert, working_to_rec709
from .extraction.light_mesh_io import extract
from .light_faces import read_faces
from .names import AREA_SCALE_ATTRIBUTE, COLOR_ATTRIBUTE, EMISSION_ATTRIBUTE, LOCK_ATTRIBUTE


def kept_lights(thing: Any, count: int) -> VirtualLightMesh | None:
    """The locked lights of `thing`, which is to have `count` lights; None without any.

    Raises InvalidInput where no other light has room beside them, or they cannot be told from the others.
    """
    locked = read_faces(thing, LOCK_ATTRIBUTE) != 0
    if not locked.any():
        return None
    keep = locked_lights(thing, locked)
    if len(keep) >= count:
        problem = f"{len(keep)} of its lights are locked, {count} are asked for"
        raise InvalidInput(f"light mesh {thing.name!r}", problem, "ask for more lights, or unlock some")
    return keep


def locked_lights(thing: Any, locked: Any) -> VirtualLightMesh:
    """The lights of the faces `locked`, (faces,) bool, without the factors of the whole light mesh, which stay.

    Raises InvalidInput where modifiers make the lights of `thing`: they cannot be told from each other.
    """
    found = extract()
    if found.light_mesh is None or found.origins is None or thing.name not in found.origins.objects:
        raise InvalidInput(f"light mesh {thing.name!r}", "it is hidden", "show it in the outliner")
    owner = found.origins.objects.index(thing.name)
    rows = found.origins.owner == owner
    if (found.origins.faces[rows] < 0).any():
        problem = "modifiers make its faces, so locked ones cannot be told"
        raise InvalidInput(f"light mesh {thing.name!r}", problem, "apply its modifiers, or unlock its lights")
    rows[rows] = locked[found.origins.faces[rows]]
    faces = found.origins.faces[rows]
    matrix = working_to_rec709()
    values = {
        "colour": convert(read_faces(thing, COLOR_ATTRIBUTE)[faces, :3], matrix),
        "emission": convert(read_faces(thing, EMISSION_ATTRIBUTE)[faces, :3], matrix),
        "strength": read_faces(thing, AREA_SCALE_ATTRIBUTE)[faces],
    }
    return replace(found.light_mesh.subset(np.asarray(rows, bool)), **values)
