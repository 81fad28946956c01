# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom properties of objects, which anybody can change: read as what they should be, or said to be something else;
and set so that evaluated copies, from which renders and overlays read, have them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.errors import InvalidInput
from ..core.scene import Float64, Int32
from .names import HUE_PROPERTY, STRENGTH_PROPERTY

LONGEST_SHOWN = 40
"""Characters of a value that a message shows."""
CHANNELS = (3, 4)
"""Numbers of a colour; a fourth does not count."""


def whole_number(thing: Any, name: str, default: int = 0) -> int:
    """A custom property that is a whole number of 32 bits, `default` where there is none. Raises InvalidInput."""
    values = _integers(thing, name, "a whole number", default)
    if values.ndim:
        raise wrong_value(thing, name, "a whole number")
    return int(values)


def whole_numbers(thing: Any, name: str) -> Int32:
    """(k,) a custom property that is a list of whole numbers, empty where there is none. Raises InvalidInput."""
    values = _integers(thing, name, "a list of whole numbers", ())
    if values.ndim != 1:
        raise wrong_value(thing, name, "a list of whole numbers")
    return values


def _integers(thing: Any, name: str, wanted: str, default: Any) -> Int32:
    stored = plain(thing.get(name, default))
    if isinstance(stored, list | tuple) and not len(stored):
        return np.zeros(0, np.int32)
    values = np.asarray(stored)
    limits = np.iinfo(np.int32)
    sound = values.dtype.kind in "biu" and bool(((values >= limits.min) & (values <= limits.max)).all())
    if not sound:
        raise wrong_value(thing, name, wanted)
    return values.astype(np.int32)


def text(thing: Any, name: str) -> str:
    """A custom property that is text, empty where there is none. Raises InvalidInput."""
    stored = thing.get(name, "")
    if not isinstance(stored, str):
        raise wrong_value(thing, name, "text")
    return stored


def numbers(thing: Any, name: str) -> Float64:
    """(k,) a custom property that is a list of numbers, empty where there is none. Raises InvalidInput."""
    values = _floats(thing, name, ())
    if values is None or values.ndim != 1:
        raise wrong_value(thing, name, "a list of numbers")
    return values


def factors(thing: Any, broken: bool = False) -> tuple[float, Float64]:
    """(strength, (3,) hue) of a light mesh: factors on what its lights send out, 1 where there are none.

    broken: whether they may be negative or no numbers, for the check to find. Raises InvalidInput.
    """
    strength, hue = _floats(thing, STRENGTH_PROPERTY, 1.0), _floats(thing, HUE_PROPERTY, (1.0, 1.0, 1.0))
    if strength is None or strength.ndim:
        raise wrong_value(thing, STRENGTH_PROPERTY, "a number")
    if hue is None or hue.ndim != 1 or len(hue) not in CHANNELS:
        raise wrong_value(thing, HUE_PROPERTY, "three numbers")
    for name, values in () if broken else ((STRENGTH_PROPERTY, strength), (HUE_PROPERTY, hue)):
        if not np.isfinite(values).all():
            raise wrong_value(thing, name, "of use: it is not finite")
        if (values < 0.0).any():
            raise wrong_value(thing, name, "of use: it is negative")
    return float(strength), hue[: CHANNELS[0]]


def _floats(thing: Any, name: str, default: Any) -> Float64 | None:
    """None where it is something else than numbers."""
    stored = plain(thing.get(name, default))
    if isinstance(stored, list | tuple) and not len(stored):
        return np.zeros(0)
    values = np.asarray(stored)
    return values.astype(np.float64) if values.dtype.kind in "biuf" else None


def plain(stored: Any) -> Any:
    """A custom property as Python has it: lists and dictionaries in place of Blender's arrays and groups."""
    for convert in ("to_list", "to_dict"):
        if hasattr(stored, convert):
            return getattr(stored, convert)()
    return stored


def set_value(thing: Any, name: str, value: Any) -> None:
    """Store a custom property so that the next evaluation of the object has it: Blender notices none by itself."""
    thing[name] = value
    thing.update_tag()


def remove_value(thing: Any, name: str) -> None:
    """Take a custom property away, for the next evaluation as well."""
    if name in thing:
        del thing[name]
        thing.update_tag()


def wrong_value(thing: Any, name: str, wanted: str) -> InvalidInput:
    """What to raise where a custom property is not what it should be."""
    shown = repr(plain(thing.get(name)))
    if len(shown) > LONGEST_SHOWN:
        shown = shown[:LONGEST_SHOWN] + "..."
    problem = f"its custom property {name} is {shown}, not {wanted}"
    return InvalidInput(f"object {thing.name!r}", problem, "correct or remove it (Object > Custom Properties)")
