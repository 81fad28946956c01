# SPDX-License-Identifier: GPL-3.0-or-later
"""Which light mesh lights that are made of objects go into: the one that stands for them already, or a new one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

from .light_meshes import is_local, light_meshes, readable_sources


def find_replaced(things: Sequence[Any], name: str, scene: Any) -> Any | None:
    """The light mesh of `scene` that one made of `things` takes the place of, None for none.

    It is the one that was made of just these objects, whatever it is called; else the one called `name` where it was
    made of some of them and of nothing else, so that no object loses its lights. What was drawn by hand stays.
    """
    known = {each: readable_sources(each, scene) for each in light_meshes(scene)}
    present = {each: set(found) - {None} for each, found in known.items()}
    same = [each for each in known if present[each] == set(things) and is_local(each)]
    named = [each for each in known if each.name == name and known[each] and present[each] <= set(things)]
    return next((each for each in (*same, *named) if each.name == name), same[0] if same else None)


def unused_name(name: str) -> str:
    """`name`, or the first of Blender's numbered names that no object has."""
    number, found = 0, name
    while found in bpy.data.objects:
        number += 1
        found = f"{name}.{number:03}"
    return found
