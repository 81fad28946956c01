# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept over frames, and what is made anew."""

from collections.abc import Callable

from vlm_addon.render.kept import Kept


def test_only_the_latest_of_each_kind_is_kept() -> None:
    kept = Kept()
    made: list[int] = []

    def make(value: int) -> Callable[[], int]:
        return lambda: made.append(value) or value

    assert [kept.get("a", key, make(int(key))) for key in "1122"] == [1, 1, 2, 2]
    assert kept.get("b", "1", make(3)) == 3
    assert kept.get("a", "1", make(4)) == 4
    assert made == [1, 2, 3, 4]
    assert kept.built == {"a": 3, "b": 1}
