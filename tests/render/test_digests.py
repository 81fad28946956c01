# SPDX-License-Identifier: GPL-3.0-or-later
"""Hashes of what a scene holds: equal where all is equal, whatever the object, and each array read once a frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import quad
from vlm_addon.core.scene import POINT, Light
from vlm_addon.render import digests
from vlm_addon.render.digests import CHUNK_BYTES, Digests

LARGE = np.arange(CHUNK_BYTES // 8 + 3, dtype=np.float64)
MESH = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))


def changed(array: np.ndarray, place: int) -> np.ndarray:
    other = array.copy()
    other.flat[place] += 1
    return other


DIFFERENT = {
    "value": ([1, 2.5], [1, 2.25]),
    "order": ([LARGE, MESH], [MESH, LARGE]),
    "nesting": ([[1, 2], 3], [[1], [2, 3]]),
    "shape": (np.zeros((2, 3)), np.zeros((3, 2))),
    "dtype": (np.zeros(2, np.float32), np.zeros(2, np.int32)),
    "empty": (np.zeros((0, 3)), np.zeros((0, 2))),
    "first": (LARGE, changed(LARGE, 0)),
    "last": (LARGE, changed(LARGE, -1)),
    "sign": (np.zeros(1), -np.zeros(1)),
    "field": (Light("l", POINT, (1.0,) * 3, (0.0,) * 3), Light("l", POINT, (1.0,) * 3, (0.0, 0.0, 1e-300))),
    "array of a field": (MESH, replace(MESH, tag_ids=MESH.tag_ids + 1)),
}


@pytest.mark.parametrize("is_remembered", [False, True], ids=["anew", "remembered"])
@pytest.mark.parametrize("name", list(DIFFERENT))
def test_what_differs_has_other_hashes(name: str, is_remembered: bool) -> None:
    first, second = DIFFERENT[name]
    found = Digests()
    if is_remembered:
        with found.remembered():
            assert found.of(first) != found.of(second)
            assert found.of(first) == found.of(first)
    assert found.of(first) != found.of(second)


def test_what_is_equal_has_the_same_hash_whatever_holds_it() -> None:
    strided = np.arange(12.0).reshape(3, 4)[:, ::2]
    backwards = np.asfortranarray(np.arange(12.0).reshape(3, 4))
    for array in (LARGE, strided, backwards, np.zeros((0, 3)), np.zeros(()), MESH):
        copy = replace(array) if array is MESH else np.array(array)
        alone, within = Digests(), Digests()
        with within.remembered():
            assert alone.of([array, 1]) == within.of([copy, 1])
            assert alone.of((array, 1)) == within.of((copy, 1))


def test_an_array_is_read_once_while_it_is_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    whole = digests._pieces
    monkeypatch.setattr(digests, "_pieces", lambda array: read.append(id(array)) or whole(array))
    found, small = Digests(), np.arange(5)
    with found.remembered():
        for _ in range(3):
            found.of(LARGE, [small, LARGE])
        assert sorted(read) == sorted([id(LARGE), id(small)])


def test_nothing_is_remembered_from_frame_to_frame() -> None:
    found, array = Digests(), LARGE.copy()
    with found.remembered():
        before = found.of(array)
    array[7] = -1.0
    with found.remembered():
        assert found.of(array) != before
    assert Digests().of(array) == found.of(array)
