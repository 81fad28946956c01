# SPDX-License-Identifier: GPL-3.0-or-later
"""Points and directions as text, so that an operator keeps any number of them at full precision for redo."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...core.errors import InvalidInput
from ...core.scene import Float64

LIKELY_SPAN = 1e7
"""Coordinates beyond this many metres are taken for a mistake: float32 has no centimetres left long before."""


def text_of(rows: Float64) -> str:
    """(n, 3) numbers as "x y z, x y z", such that `rows_of` returns the same float64 values."""
    return ", ".join(" ".join(repr(float(value)) for value in row) for row in np.reshape(rows, (-1, 3)))


def rows_of(text: str, what: str) -> Float64:
    """(n, 3) float64 from numbers that are parted by spaces, commas or semicolons.

    Raises InvalidInput, naming `what`, where something is no number, not finite, not three to a row or out of bounds.
    """
    words = re.split(r"[\s,;]+", text.strip(" \t\r\n,;"))
    try:
        values = np.array([float(word) for word in words if word], np.float64)
    except ValueError as error:
        raise InvalidInput(what, str(error), 'give them as "x y z, x y z"') from error
    if len(values) % 3:
        raise InvalidInput(what, f"{len(values)} numbers are not three to a point", 'give them as "x y z, x y z"')
    if not (np.abs(values) <= LIKELY_SPAN).all():
        raise InvalidInput(what, f"a number is not finite or beyond {LIKELY_SPAN:g}", "give points in meters")
    return values.reshape(-1, 3)


def directions_of(text: str, count: int, what: str) -> Float64:
    """(count, 3) float64 unit vectors; one row stands for all, and none gives zeros, which stands for "not known".

    Raises InvalidInput for another number of rows or one without length.
    """
    rows = rows_of(text, what)
    if not len(rows):
        return np.zeros((count, 3))
    if len(rows) not in (1, count):
        raise InvalidInput(what, f"{len(rows)} directions for {count} points", "give one for all, or one for each")
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    if not (lengths > 0.0).all():
        raise InvalidInput(what, "a direction has no length", "give directions such as 0 0 1, or none")
    return np.broadcast_to(rows / lengths, (count, 3)).copy()


def stroke(points: str, normals: str, least: int, normals_needed: bool = False) -> tuple[Float64, Float64]:
    """Points (n, 3) of a stroke and the unit directions of the surface there, zero where they are not known.

    Raises InvalidInput for fewer than `least` points, and for no directions where they are needed.
    """
    places = rows_of(points, "points")
    if len(places) < least:
        problem = f"there are {len(places)}, not at least {least}"
        raise InvalidInput("points", problem, 'draw in the 3D view, or give them as "x y z, x y z"')
    directions = directions_of(normals, len(places), "normals")
    if normals_needed and not directions.any():
        raise InvalidInput("normals", "there are none", "give the direction that the surface faces in, such as 0 0 1")
    return places, directions


def exactly(points: str, count: int, what: str) -> Float64:
    """(count, 3) points. Raises InvalidInput, naming `what`, for another number."""
    places = rows_of(points, what)
    if len(places) != count:
        raise InvalidInput(what, f"it has {len(places)} points, not {count}", 'give them as "x y z, x y z"')
    return places


def require_distance(value: float, what: str) -> None:
    """Raises InvalidInput, naming `what`, where `value`, m, is no number or out of bounds."""
    if not 0.0 <= value <= LIKELY_SPAN:
        raise InvalidInput(what, f"it is {value:g} m", f"give meters from 0 to {LIKELY_SPAN:g}")


def mean(normals: Float64) -> Float64:
    """(1, 3): the sum of directions; which side counts, not the length."""
    return normals.sum(axis=0, keepdims=True)


def vector(values: Sequence[float]) -> Float64:
    """(3,) float64 of a property of three numbers."""
    return np.array(values, np.float64)


def repeated(normal: Float64, count: int) -> Float64:
    """(count, 3): one direction for each of `count` faces."""
    return np.tile(normal, (count, 1))
