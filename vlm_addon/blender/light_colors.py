# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of lights changed in the open file: all that is to be written is worked out before the first face changes.

Colours of faces are in the file's working space, as the colours of Blender's own properties are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core import color_changes
from ..core.color_changes import ColorChange, require_colors
from ..core.counting import counted
from ..core.errors import InvalidInput
from ..core.mesh_topology import Bool
from ..core.scene import Float64
from .light_faces import chosen_faces, read_faces, write_faces
from .light_factors import NEUTRAL_HUE, NEUTRAL_STRENGTH, describe_factors
from .light_geometry import LightFaces, light_faces_in_world
from .light_meshes import require_editable
from .names import (
    AREA_SCALE_ATTRIBUTE,
    COLOR_ATTRIBUTE,
    EMISSION_ATTRIBUTE,
    HUE_PROPERTY,
    LOCK_ATTRIBUTE,
    STRENGTH_PROPERTY,
)
from .stored_values import factors

COLOR, EMISSION, BOTH = "COLOR", "EMISSION", "BOTH"
QUANTITIES = (
    (COLOR, "Color", "What of the light that arrives is sent on: reflectance times your own factor"),
    (EMISSION, "Emission", "What the lights send out by themselves, in W/m²"),
    (BOTH, "Color and Emission", "Both"),
)
"""Items of a Blender enum: which values of a light a tool changes."""
ATTRIBUTES = {
    COLOR: (COLOR_ATTRIBUTE,),
    EMISSION: (EMISSION_ATTRIBUTE,),
    BOTH: (COLOR_ATTRIBUTE, EMISSION_ATTRIBUTE),
}
DIRECTION, POINTS = "DIRECTION", "POINTS"
PLACEMENTS = (
    (DIRECTION, "Direction", "From the first to the last selected light along a direction"),
    (POINTS, "Points", "Between two points"),
)
"""Items of a Blender enum: where a gradient runs."""


@dataclass(frozen=True)
class FaceValues:
    """What is to be written: values of one attribute for all faces of one light mesh, and how many of them change."""

    thing: Any
    attribute: str
    values: np.ndarray
    changed: int


def change_colors(things: Sequence[Any], change: ColorChange, quantity: str) -> int:
    """Apply `change` to the chosen faces of light meshes; returns how many faces.

    quantity: one of QUANTITIES. Raises InvalidInput where a light mesh cannot be changed or a colour would not be
    finite and non-negative; nothing is changed then.
    """
    planned = [
        values
        for thing in one_per_mesh(things)
        for values in changed_colors(thing, chosen_faces(thing), change, quantity)
    ]
    return write_planned(planned)


def changed_colors(thing: Any, chosen: Bool, change: ColorChange, quantity: str) -> list[FaceValues]:
    """What `change` makes of the faces `chosen`, (n,) bool, of one light mesh. Raises InvalidInput."""
    require_editable(thing)
    middles = light_faces_in_world(thing).middles[chosen]
    return [
        new_values(thing, name, chosen, lambda colors: change(colors, middles), colors=True)
        for name in ATTRIBUTES[quantity]
    ]


def new_values(
    thing: Any, name: str, chosen: Bool, change: Callable[[Float64], Float64], colors: bool = False
) -> FaceValues:
    """The values of an attribute with `change` applied to the rows `chosen`, (n,) bool.

    colors: `change` sees and gives the first three components alone, and they must be colours that a light can have.
    """
    values = read_faces(thing, name)
    if colors:
        rows = change(values[chosen, :3].astype(np.float64))
        require_colors(rows, f"light mesh {thing.name!r}, {name}")
        values[chosen, :3] = rows
    else:
        values[chosen] = change(values[chosen])
    return FaceValues(thing, name, values, int(chosen.sum()))


def write_planned(planned: Sequence[FaceValues]) -> int:
    """Write all values; returns how many faces changed, each counted once."""
    for each in planned:
        if each.changed:
            write_faces(each.thing, each.attribute, each.values)
    counted = {each.thing.name_full: each.changed for each in planned}
    return sum(counted.values())


def gradient_ends(
    things: Sequence[Any], placement: str, direction: Sequence[float], start: Sequence[float], end: Sequence[float]
) -> tuple[Sequence[float], Sequence[float]]:
    """The two points, m in world space, between which a gradient over the chosen lights runs. Raises InvalidInput."""
    if placement == POINTS:
        return start, end
    low, high = color_changes.extent_along(chosen_middles(things), direction)
    return tuple(low.tolist()), tuple(high.tolist())


def gradient(
    ends: tuple[Sequence[float], Sequence[float]], first: Sequence[float], last: Sequence[float], multiplies: bool
) -> ColorChange:
    """The change that a gradient between two points makes. Raises InvalidInput."""
    change = color_changes.gradient(*ends, first, last)
    return color_changes.over(change) if multiplies else change


def chosen_middles(things: Sequence[Any]) -> Float64:
    """(n, 3) m: the middles of all chosen lights. Raises InvalidInput where there are none."""
    return _of_chosen(things, lambda faces: faces.middles)


def chosen_areas(things: Sequence[Any]) -> Float64:
    """(n,) m²: the areas of all chosen lights. Raises InvalidInput where there are none."""
    return _of_chosen(things, lambda faces: faces.areas)


def _of_chosen(things: Sequence[Any], value: Callable[[LightFaces], Float64]) -> Float64:
    found = [value(light_faces_in_world(thing))[chosen_faces(thing)] for thing in things]
    if not sum(map(len, found)):
        raise InvalidInput("the selection", "no light is chosen", "select faces of the light mesh")
    return np.concatenate(found)


def lock(things: Sequence[Any], locked: bool) -> int:
    """Lock or unlock the chosen faces of light meshes; returns how many were not so before. Raises InvalidInput."""
    planned = []
    for thing in one_per_mesh(things):
        require_editable(thing)
        chosen = chosen_faces(thing) & ((read_faces(thing, LOCK_ATTRIBUTE) != 0) != locked)
        planned.append(new_values(thing, LOCK_ATTRIBUTE, chosen, lambda rows: np.full_like(rows, locked)))
    return write_planned(planned)


def set_strength(things: Sequence[Any], strength: float, hue: Sequence[float]) -> int:
    """Give light mesh objects a multiplier of strength and of each channel; returns how many. Raises InvalidInput."""
    for thing in things:
        require_editable(thing)
        subject = f"light mesh {thing.name!r}, strength and hue"
        require_colors(np.array([[strength] * 3, list(hue)], np.float64), subject)
        most = strength * max(hue) * _brightest(thing)
        if not most <= color_changes.LARGEST:
            raise InvalidInput(subject, f"its lights would send out {most:.2g}, more than can be stored", "use less")
    for thing in things:
        thing[STRENGTH_PROPERTY] = float(strength)
        thing[HUE_PROPERTY] = tuple(float(value) for value in hue)
        describe_factors(thing)
        thing.update_tag()
    return len(things)


def _brightest(thing: Any) -> float:
    """The largest value of any light before strength and hue, of area made up for and of neither."""
    scale = np.maximum(read_faces(thing, AREA_SCALE_ATTRIBUTE).astype(np.float64), 1.0)
    faces = [read_faces(thing, name)[:, :3].max(axis=1, initial=0.0) * scale for name in ATTRIBUTES[BOTH]]
    return float(np.concatenate(faces).max(initial=0.0))


def strength_of(thing: Any) -> tuple[float, tuple[float, ...]]:
    """Strength and hue of a light mesh object, neutral where they are not what they should be."""
    try:
        strength, hue = factors(thing)
    except InvalidInput:
        return NEUTRAL_STRENGTH, NEUTRAL_HUE
    return strength, tuple(hue.tolist())


def light_mesh_count(count: int) -> str:
    """A number of light meshes in words."""
    return counted(count, "light mesh")


def one_per_mesh(things: Sequence[Any]) -> list[Any]:
    """The first of all objects that share a mesh: their lights are the same faces."""
    return list({thing.data.name_full: thing for thing in reversed(things)}.values())[::-1]
