# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings as frozen dataclasses whose fields carry unit, range, text and source.

The command line, the Blender properties and the tests all read the same fields.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from .errors import InvalidInput

S = TypeVar("S")

OWN = "own"
"""Source of a setting that is in no document."""


@dataclasses.dataclass(frozen=True)
class SettingInfo:
    """What a user may know of one setting: its type, default, unit, inclusive range, tooltip text and source.

    only_with: the other setting and its value without which this one does nothing; None if it always counts.
    """

    name: str
    type: type
    default: Any
    unit: str
    low: float | None
    high: float | None
    text: str
    source: str
    choices: tuple[str, ...]
    only_with: tuple[str, str] | None

    @property
    def span(self) -> str:
        """What values there are, in words."""
        if self.type is bool:
            return "true or false"
        if self.type is str and not self.choices:
            return self.unit
        return ", ".join(self.choices) if self.choices else f"{self.low} to {self.high} {self.unit}".strip()


def setting(
    default: Any,
    unit: str,
    low: float | None,
    high: float | None,
    text: str,
    *,
    source: str = "",
    choices: tuple[str, ...] = (),
    only_with: tuple[str, str] | None = None,
) -> Any:
    """A dataclass field that carries what SettingInfo says of it."""
    metadata = {
        "unit": unit,
        "low": low,
        "high": high,
        "text": text,
        "source": source,
        "choices": choices,
        "only_with": only_with,
    }
    return dataclasses.field(default=default, metadata=metadata)


def describe(settings_type: type) -> Iterator[SettingInfo]:
    """The settings of a dataclass in order of definition."""
    for field in dataclasses.fields(settings_type):
        yield SettingInfo(name=field.name, type=type(field.default), default=field.default, **field.metadata)


def from_mapping(settings_type: type[S], values: Mapping[str, Any], owner: str) -> S:
    """Settings of `settings_type` with `values` (numbers, or texts as typed on a command line) in place of defaults.

    Raises InvalidInput as `checked_values`.
    """
    return settings_type(**checked_values(settings_type, values, owner))


def checked_values(settings_type: type, values: Mapping[str, Any], owner: str) -> dict[str, Any]:
    """`values` as values of the types that the settings of `settings_type` have.

    Raises InvalidInput for an unknown name, what is not of the setting's type, or a value out of range; `owner` names
    whose settings they are in the message.
    """
    known = {info.name: info for info in describe(settings_type)}
    for name in values:
        if name not in known:
            raise InvalidInput(
                f"setting {name!r} of {owner}",
                "no such setting",
                f"use one of: {', '.join(known) or 'none, it has no settings'}",
            )
    return {name: _checked(known[name], value, owner) for name, value in values.items()}


def _checked(info: SettingInfo, value: Any, owner: str) -> Any:
    subject = f"setting {info.name!r} of {owner}"
    try:
        converted = _convert(info.type, value)
    except (TypeError, ValueError, OverflowError):
        problem = f"{value!r} is not of type {info.type.__name__}"
        raise InvalidInput(subject, problem, "give a value of that type") from None
    if info.choices and converted not in info.choices:
        raise InvalidInput(subject, f"{converted!r} is not a choice", f"use one of: {', '.join(info.choices)}")
    below = info.low is not None and not converted >= info.low
    above = info.high is not None and not converted <= info.high
    if below or above:
        remedy = f"give {info.low} to {info.high} {info.unit}".rstrip()
        raise InvalidInput(subject, f"{converted} is out of range", remedy)
    return converted


def _convert(wanted: type, value: Any) -> Any:
    if wanted is bool and isinstance(value, str):
        if value.lower() in ("true", "on", "yes", "1"):
            return True
        if value.lower() in ("false", "off", "no", "0"):
            return False
        raise ValueError(value)
    converted = wanted(value)
    if wanted is int and not isinstance(value, str) and converted != value:
        raise ValueError(value)
    return converted
