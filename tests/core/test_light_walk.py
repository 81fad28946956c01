# SPDX-License-Identifier: GPL-3.0-or-later
"""How many lights go on at each bounce, and the means over surfaces that decide it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.render.rooms import quad
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_walk import bounce_counts, bounce_shift, surface_means

COUNTS = st.integers(1, 70_000)
BLOCKS = st.integers(1, 64)


@given(COUNTS, st.integers(1, 3), st.floats(0.0, 2.0), BLOCKS)
def test_bounces_share_the_lights_in_blocks(count: int, bounces: int, reflectance: float, block: int) -> None:
    found = bounce_counts(count, bounces, reflectance, block)
    assert len(found) == bounces
    assert all(number % block == 0 for number in found)
    assert count <= sum(found) < count + bounces * block
    assert sorted(found, reverse=True) == list(found)


@given(COUNTS, st.integers(2, 3), st.floats(1e-6, 1.0), BLOCKS)
def test_as_many_go_on_as_survive(count: int, bounces: int, reflectance: float, block: int) -> None:
    """Within what whole blocks, and one at least for each bounce, allow."""
    found = bounce_counts(count, bounces, reflectance, block)
    assert min(found) >= block
    for before, after in pairwise(found):
        assert abs(after - reflectance * before) <= 2 * block


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_where_nothing_reflects_all_lights_are_of_the_first_bounce(bounces: int) -> None:
    assert bounce_counts(512, bounces, 0.0, 16) == (512, 0, 0)[:bounces]


def test_where_all_is_reflected_all_bounces_have_as_many() -> None:
    assert bounce_counts(96, 3, 1.0, 16) == bounce_counts(96, 3, 7.0, 16) == (32, 32, 32)


def test_half_of_them_go_on_where_half_is_reflected() -> None:
    assert bounce_counts(1792, 3, 0.5, 16) == (1024, 512, 256)


@pytest.mark.parametrize(("count", "bounces", "block"), [(0, 1, 1), (1, 0, 1), (1, 1, 0)])
def test_nothing_to_share_is_refused(count: int, bounces: int, block: int) -> None:
    with pytest.raises(InvalidInput, match="virtual point lights"):
        bounce_counts(count, bounces, 0.5, block)


def test_means_are_over_the_area() -> None:
    large = replace(quad((0, 0, 0), (3, 0, 0), (0, 1, 0)), reflectance=np.tile(np.float32([0.5, 0.0, 1.0]), (2, 1)))
    small = replace(quad((0, 0, 5), (1, 0, 0), (0, 1, 0)), reflectance=np.tile(np.float32([0.1, 0.8, 0.0]), (2, 1)))
    found = surface_means([large, small])
    assert found.area == pytest.approx(4.0)
    np.testing.assert_allclose(found.reflectance, [0.4, 0.2, 0.75], rtol=1e-6)


def test_no_surface_has_no_area_and_reflects_nothing() -> None:
    found = surface_means([])
    assert found.area == 0.0
    assert not found.reflectance.any()


def test_the_first_bounce_keeps_its_shift() -> None:
    assert bounce_shift((0.25, 0.75), 1) == (0.25, 0.75)


@pytest.mark.parametrize("number", [2, 3])
def test_shifts_of_bounces_are_even_and_independent_of_the_first(number: int) -> None:
    """Of 36 x 36 pairs of old and new coordinate each has its share."""
    for axis in (0, 1):
        first = np.random.default_rng(axis).random(60_000)
        found = np.array([bounce_shift((value, value), number)[axis] for value in first])
        assert ((found >= 0.0) & (found < 1.0)).all()
        filled, _, _ = np.histogram2d(first, found, bins=36, range=((0, 1), (0, 1)))
        expected = len(first) / 36**2
        assert ((filled - expected) ** 2 / expected).sum() < 36**2 + 4.0 * np.sqrt(2.0 * 36**2)
