# SPDX-License-Identifier: GPL-3.0-or-later
"""What evenly spread numbers have to be: all of any 4 x 4 pixels together, and those of a pixel over its samples."""

import numpy as np
import pytest

from vlm_addon.core.spread_pattern import SIDE, bayer_rank, spread_pattern


def square(corner, side=SIDE):
    y, x = np.divmod(np.arange(side * side), side)
    return np.stack([x, y], axis=1).astype(np.uint32) + np.asarray(corner, np.uint32)


def largest_gap(values):
    ordered = np.sort(values)
    return np.diff(np.append(ordered, ordered[0] + 1.0)).max()


@pytest.mark.parametrize("corner", [(0, 0), (1, 0), (3, 2), (1021, 77)])
def test_any_square_of_pixels_has_every_rank_once(corner):
    assert sorted(bayer_rank(square(corner))) == list(range(16))


@pytest.mark.parametrize("corner", [(0, 0), (1, 1), (2, 3)])
def test_any_two_by_two_pixels_leave_no_half_empty(corner):
    ranks = bayer_rank(square(corner, 2)).astype(float) / 16.0
    assert largest_gap(ranks) <= 7.0 / 16.0


@pytest.mark.parametrize("sample", [0, 1, 7, 4095])
@pytest.mark.parametrize("count", [1, 4, 16])
def test_thresholds_of_a_square_and_radical_inverses_are_as_even_as_can_be(count, sample):
    pixels = square((5, 2))
    first = np.concatenate([(k + spread_pattern(pixels, k, sample)[:, 0]) / count for k in range(count)])
    second = np.concatenate([spread_pattern(pixels, k, sample)[:, 1] for k in range(count)])
    for values in (first, second):
        assert ((values >= 0.0) & (values < 1.0)).all()
        assert largest_gap(values) == pytest.approx(1.0 / (16 * count), rel=1e-3)


@pytest.mark.parametrize("count", [4, 16, 64])
def test_the_samples_of_a_pixel_are_spread_in_both_numbers(count):
    pixel = np.array([[6, 11]], np.uint32)
    points = np.concatenate([spread_pattern(pixel, 0, sample) for sample in range(count)])
    # Suprema over all counts of gaps between multiples of the golden ratio and of the root of 2.
    for values, most in zip(points.T, (1.9, 2.07), strict=True):
        assert largest_gap(values) <= most / count


def test_indices_share_the_first_number():
    pixels = square((0, 0))
    assert (spread_pattern(pixels, 0, 3)[:, 0] == spread_pattern(pixels, 9, 3)[:, 0]).all()
