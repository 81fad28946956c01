# SPDX-License-Identifier: GPL-3.0-or-later
"""A light mesh made anew of what it was made from, around the lights that an artist has locked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..bake import BakeSettings
from ..core.errors import InvalidInput
from ..core.progress import Progress
from ..core.tag_pairs import FIRST_AUTOMATIC
from .authoring import Made, from_objects
from .light_meshes import require_editable, source_names, sources, tags_of
from .locked_lights import kept_lights
from .names import is_light_mesh


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
        return f"{thing.name} was drawn by hand: draw into it, or create another one from objects"
    if not any(source is not None for source in known):
        return f"All that {thing.name} was made from is gone: undo, or create another light mesh"
    return "Leave this mode first (Tab): light meshes are made in Object Mode" if context.mode != "OBJECT" else None


def again(context: Any, settings: BakeSettings, tag_regions: bool) -> Callable[[Progress], Made]:
    """Work that makes the active light mesh of its sources again. Raises InvalidInput where it cannot be changed.

    tag_regions: as for creation; a light mesh that pairing has tagged is tagged again in any case.
    """
    thing = context.active_object
    require_editable(thing)
    tag_regions |= bool((tags_of(thing) >= FIRST_AUTOMATIC).any())
    things = [source for source in sources(thing, context.scene) if source is not None]
    known = zip(source_names(thing), sources(thing, context.scene), strict=True)
    gone = tuple(name for name, source in known if source is None)
    keep = kept_lights(thing, settings.target_triangles)
    return from_objects(things, thing.name, settings, tag_regions, keep, gone)
