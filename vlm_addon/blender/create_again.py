# SPDX-License-Identifier: GPL-3.0-or-later
"""A light mesh made anew of what it was made from, around the lights that an artist has locked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..bake import BakeSettings
from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.tag_pairs import FIRST_AUTOMATIC
from .authoring import Made, from_objects
from .extraction.color_space import convert, working_to_rec709
from .extraction.light_mesh_io import extract
from .light_faces import read_faces
from .light_meshes import require_editable, sources, tags_of
from .names import AREA_SCALE_ATTRIBUTE, COLOR_ATTRIBUTE, EMISSION_ATTRIBUTE, LOCK_ATTRIBUTE, is_light_mesh


def again_problem(context: Any) -> str | None:
    """Why the active object cannot be made anew, or None."""
    thing = context.active_object
    if thing is None or not is_light_mesh(thing):
        return "Select the light mesh that is to be made again"
    try:
        known = sources(thing, context.scene)
    except InvalidInput as error:
        return str(error)
    if not known:
        return f"{thing.name} was drawn by hand: there is nothing to make it from"
    if not any(source is not None for source in known):
        return f"All that {thing.name} was made from is gone"
    return "Leave this mode first (Tab): light meshes are made in Object Mode" if context.mode != "OBJECT" else None


def again(context: Any, settings: BakeSettings, tag_regions: bool) -> Callable[[Progress], Made]:
    """Work that makes the active light mesh of its sources again. Raises InvalidInput where it cannot be changed.

    tag_regions: as for creation; a light mesh that pairing has tagged is tagged again in any case.
    """
    thing = context.active_object
    require_editable(thing)
    tag_regions |= bool((tags_of(thing) >= FIRST_AUTOMATIC).any())
    things = [source for source in sources(thing, context.scene) if source is not None]
    locked = read_faces(thing, LOCK_ATTRIBUTE) != 0
    keep = locked_lights(thing, locked) if locked.any() else None
    if keep is not None and len(keep) >= settings.target_triangles:
        problem = f"{len(keep)} of its lights are locked, {settings.target_triangles} are asked for"
        raise InvalidInput(f"light mesh {thing.name!r}", problem, "ask for more lights, or unlock some")
    return from_objects(things, thing.name, settings, tag_regions, keep)


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
