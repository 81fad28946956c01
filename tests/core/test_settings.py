# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import dataclass

import numpy as np
import pytest

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.settings import describe, from_mapping, setting


@dataclass(frozen=True)
class Example:
    count: int = setting(200, "count", 1, 4096, "How many", source="paper, 3.1")
    reach: float = setting(2.5, "m", 0.0, None, "How far")
    on: bool = setting(True, "", None, None, "Whether")
    mode: str = setting("fast", "", None, None, "Which", choices=("fast", "good"))


def test_text_from_a_command_line_becomes_typed_values():
    assert from_mapping(Example, {"count": "7", "reach": "0.5", "on": "off", "mode": "good"}, "x") == Example(
        7, 0.5, False, "good"
    )


def test_without_values_the_defaults_stand():
    assert from_mapping(Example, {}, "x") == Example()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("count", "0", "out of range"),
        ("count", "4097", "out of range"),
        ("count", "many", "not of type int"),
        ("count", 1.5, "not of type int"),
        ("count", None, "not of type int"),
        ("count", np.float32(1.5), "not of type int"),
        ("count", float("inf"), "not of type int"),
        ("reach", [1.0], "not of type float"),
        ("reach", "nan", "out of range"),
        ("reach", "-1", "out of range"),
        ("on", "perhaps", "not of type bool"),
        ("mode", "best", "not a choice"),
        ("colour", "1", "no such setting"),
    ],
)
def test_a_bad_value_names_the_setting_and_its_owner(name, value, says):
    with pytest.raises(InvalidInput, match=says) as caught:
        from_mapping(Example, {name: value}, "technique vlm")
    assert name in str(caught.value)
    assert "technique vlm" in str(caught.value)


def test_describe_gives_unit_range_and_source():
    first = next(describe(Example))
    assert (first.name, first.type, first.unit, first.low, first.high, first.source) == (
        "count", int, "count", 1, 4096, "paper, 3.1",
    )  # fmt: skip
