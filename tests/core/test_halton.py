# SPDX-License-Identifier: GPL-3.0-or-later
"""Halton's points against values written down by hand, exact fractions and what evenly spread means."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.halton import halton_points, radical_inverse


def test_first_values_of_both_bases() -> None:
    assert radical_inverse(range(8), 2).tolist() == [0, 1 / 2, 1 / 4, 3 / 4, 1 / 8, 5 / 8, 3 / 8, 7 / 8]
    assert radical_inverse(range(9), 3).tolist() == [0, 1 / 3, 2 / 3, 1 / 9, 4 / 9, 7 / 9, 2 / 9, 5 / 9, 8 / 9]


@pytest.mark.parametrize("base", [2, 3, 5, 10])
def test_digits_mirrored_at_the_point_in_exact_fractions(base: int) -> None:
    indices = np.random.default_rng(1).integers(0, 10**9, 200)
    for index, found in zip(indices.tolist(), radical_inverse(indices, base).tolist(), strict=True):
        exact, weight = Fraction(0), Fraction(1, base)
        while index:
            exact, index, weight = exact + index % base * weight, index // base, weight / base
        assert found == float(exact)


@pytest.mark.parametrize(("base", "power"), [(2, 10), (3, 6)])
def test_every_run_of_a_power_of_the_base_has_one_point_in_each_interval(base: int, power: int) -> None:
    count = base**power
    for first in (0, 3 * count):
        cells = np.floor(radical_inverse(np.arange(first, first + count), base) * count + 1e-9).astype(int)
        assert sorted(cells.tolist()) == list(range(count))


def test_points_are_the_inverses_from_the_first_index_on() -> None:
    points = halton_points(5, first=7)
    assert points.shape == (5, 2)
    assert (points[:, 0] == radical_inverse(np.arange(7, 12), 2)).all()
    assert (points[:, 1] == radical_inverse(np.arange(7, 12), 3)).all()
    assert (halton_points(3) == halton_points(4)[:3]).all()
    assert halton_points(0).shape == (0, 2)


def test_mean_of_a_product_converges_as_even_points_do() -> None:
    points = halton_points(5000)
    assert abs((points[:, 0] * points[:, 1]).mean() - 0.25) < 5e-4


@pytest.mark.parametrize(("indices", "base"), [([-1], 2), ([1], 1)])
def test_refuses_what_has_no_digits(indices: list[int], base: int) -> None:
    with pytest.raises(InvalidInput):
        radical_inverse(indices, base)
