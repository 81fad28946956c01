# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept over frames, and what is made anew."""

from collections.abc import Callable

import pytest

from vlm_addon.render.kept import Kept, Reuse


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


def one(value: int = 1) -> int:
    return value


def test_a_frame_says_what_it_made_and_what_it_took_as_it_was() -> None:
    kept = Kept()
    with kept.frame():
        kept.get("tree", "1", one)
        kept.several("map", "1", one)
        kept.several("map", "2", one)
        assert kept.events() == {"tree": Reuse(1, 0), "map": Reuse(2, 0)}
    with kept.frame():
        assert kept.events() == {}
        kept.get("tree", "1", one)
        kept.several("map", "2", one)
        kept.several("map", "3", one)
        kept.count("texture", is_new=True)
    assert kept.events() == {"tree": Reuse(0, 1), "map": Reuse(1, 1), "texture": Reuse(1, 0)}
    assert kept.built == {"tree": 1, "map": 3, "texture": 1}


def test_what_a_finished_frame_did_not_ask_for_is_let_go_of() -> None:
    kept = Kept()
    with kept.frame():
        kept.several("map", "1", one)
        kept.several("map", "2", one)
    with kept.frame():
        kept.several("map", "2", one)
    with kept.frame():
        kept.several("map", "1", one)
        kept.several("map", "2", one)
    assert kept.events() == {"map": Reuse(1, 1)}


def test_a_frame_that_is_not_whole_lets_go_of_nothing() -> None:
    kept = Kept()
    for is_whole in (True, False, True):
        with kept.frame(is_whole):
            if is_whole:
                kept.several("map", "1", one)
    assert kept.events() == {"map": Reuse(0, 1)}


def test_a_frame_that_failed_lets_go_of_nothing() -> None:
    kept = Kept()
    with kept.frame():
        kept.several("map", "1", one)
    with pytest.raises(KeyError), kept.frame():
        raise KeyError
    with kept.frame():
        kept.several("map", "1", one)
    assert kept.events() == {"map": Reuse(0, 1)}


def test_what_cannot_be_made_is_not_kept() -> None:
    kept = Kept()

    def fail() -> int:
        raise KeyError

    for get in (kept.get, kept.several):
        with pytest.raises(KeyError):
            get("a", "1", fail)
        assert get("a", "1", one) == 1


def test_parts_keep_the_same_kinds_apart_and_name_themselves() -> None:
    kept = Kept()
    for expected in (Reuse(1, 0), Reuse(0, 1)):
        with kept.frame():
            assert kept.get("tree", "1", one) == 1
            assert kept.part("rest").get("tree", "2", lambda: 2) == 2
        assert kept.events() == {"tree": expected, "rest tree": expected}
    with kept.frame():
        pass
    assert kept.events() == {}


class Keeper:
    def __init__(self) -> None:
        self.ended = 0

    def end_frame(self) -> None:
        self.ended += 1


def test_what_keeps_things_itself_is_told_of_the_ends_of_frames() -> None:
    kept = Kept()
    keeper = kept.hold("maps", Keeper)
    inner = kept.part("rest").hold("maps", Keeper)
    assert kept.hold("maps", Keeper) is keeper
    with kept.frame():
        assert keeper.ended == 0
    with pytest.raises(KeyError), kept.frame():
        raise KeyError
    assert keeper.ended == inner.ended == 1
