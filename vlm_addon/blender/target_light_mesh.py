# SPDX-License-Identifier: GPL-3.0-or-later
"""Which light mesh lights that are made of objects go into: the one that stands for them already, or a new one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import bpy

from .light_meshes import is_local, light_meshes, readable_sources

LONGEST_NAME = 63
"""Bytes of a name that every supported version of Blender stores whole."""
NUMBER = re.compile(r"\.\d{3,}")


def find_replaced(things: Sequence[Any], name: str, scene: Any) -> Any | None:
    """The light mesh of `scene` that one made of `things` takes the place of, None for none.

    It is the one that was made of just these objects, whatever it is called; else the one called `name`, with or
    without a number of Blender's, where it was made of some of them and of nothing else, so that no object loses its
    lights. What was drawn by hand stays.
    """
    name = short_name(name)
    known = {each: readable_sources(each, scene) for each in light_meshes(scene)}
    present = {each: set(found) - {None} for each, found in known.items()}
    same = [each for each in known if present[each] == set(things) and is_local(each)]
    named = [each for each in known if _is_called(each, name) and known[each] and present[each] <= set(things)]
    exact = next((each for each in (*same, *named) if each.name == name), None)
    return exact or next(iter((*same, *(each for each in named if is_local(each)))), None)


def _is_called(thing: Any, name: str) -> bool:
    """Names are those of the whole file: in a second scene Blender numbers ours."""
    return thing.name == name or (thing.name.startswith(name) and bool(NUMBER.fullmatch(thing.name[len(name) :])))


def short_name(name: str, number: str = "") -> str:
    """`name` with a number, as Blender can store it: cut at its end where it is too long."""
    room = LONGEST_NAME - len(number.encode())
    return name.encode()[:room].decode(errors="ignore") + number


def unused_name(name: str) -> str:
    """`name`, or the first of Blender's numbered names that no object has, short enough to be stored."""
    number, found = 0, short_name(name)
    while found in bpy.data.objects:
        number += 1
        found = short_name(name, f".{number:03}")
    return found
