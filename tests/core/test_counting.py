# SPDX-License-Identifier: GPL-3.0-or-later
"""One is one and all else is many."""

from __future__ import annotations

import pytest

from vlm_addon.core.counting import counted, counted_verb


@pytest.mark.parametrize(
    ("count", "noun", "told"),
    [
        (0, "light", "0 lights"),
        (1, "light", "1 light"),
        (2, "locked light", "2 locked lights"),
        (12_345, "light mesh", "12,345 light meshes"),
        (1, "light mesh", "1 light mesh"),
        (3, "vertex", "3 vertices"),
    ],
)
def test_numbers_have_their_noun(count: int, noun: str, told: str) -> None:
    assert counted(count, noun) == told


def test_the_verb_follows_the_number() -> None:
    assert counted_verb(1, "light", "stands", "stand") == "1 light stands"
    assert counted_verb(2, "light", "stands", "stand") == "2 lights stand"
