# SPDX-License-Identifier: GPL-3.0-or-later
"""Telling an object from its copies: which of them a light mesh stands for, where ids alone cannot say.

Blender copies custom properties with an object, so duplicates and appended copies share its id. A light mesh belongs
with the copy that stands to it as the source stood when the light mesh was made; among several of those, where the
light mesh was copied as often as its source, each with each in order of name; else the one that has the source's name.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InvalidInput
from .names import SOURCE_PLACES_PROPERTY
from .stored_values import numbers

Place = npt.NDArray[np.float64]

PLACE_SIZE = 12
"""Numbers of a place: the first three rows of a matrix."""
SAME_PLACE = 1e-4
"""Difference of two equal places, as a share of their largest number (at least of 1): Blender's are float32."""


def place_of(source: Any, light_mesh: Any) -> Place:
    """(12,) where `source` stands as the light mesh sees it, zeros where the light mesh is flat in some direction."""
    matrix = light_mesh.matrix_world.inverted_safe() @ source.matrix_world
    return np.array(matrix, np.float64)[:3].ravel()


def stored_places(light_mesh: Any, count: int) -> list[Place]:
    """`place_of` of each of `count` sources when the light mesh was made, zeros where that is not known."""
    try:
        values = numbers(light_mesh, SOURCE_PLACES_PROPERTY)
    except InvalidInput:
        values = np.zeros(0)
    if len(values) != count * PLACE_SIZE:
        return [np.zeros(PLACE_SIZE)] * count
    return list(values.reshape(count, PLACE_SIZE))


def right_copy(copies: Sequence[Any], name: str, place: Place, light_mesh: Any, twins: Sequence[Any]) -> Any:
    """The one of `copies` that `light_mesh` was made from, when it was called `name`.

    place: of the source, as stored. twins: the light mesh and its own copies, in order of name.
    """
    in_place = [each for each in copies if _same(place_of(each, light_mesh), place)]
    ordered = sorted(in_place or copies, key=lambda each: (each.name != name, each.name))
    return ordered[twins.index(light_mesh)] if len(twins) == len(ordered) else ordered[0]


def _same(one: Place, other: Place) -> bool:
    size = max(1.0, float(np.abs(one).max()), float(np.abs(other).max()))
    return bool(np.abs(one - other).max() <= SAME_PLACE * size)
