# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.metrics import flip, mean_relative_error, point_error, rank_value, relative_rmse, similarity

REFERENCE = np.full((8, 8, 3), 0.5, np.float32)


def test_a_uniform_excess_of_a_tenth_is_a_relative_rmse_of_a_tenth():
    assert relative_rmse(1.1 * REFERENCE, REFERENCE) == pytest.approx(0.1, rel=1e-6)


def test_rmse_weighs_one_wrong_pixel_by_its_share():
    image = REFERENCE.copy()
    image[0, 0] = 1.0
    assert relative_rmse(image, REFERENCE) == pytest.approx(np.sqrt(1 / 64), rel=1e-6)
    assert mean_relative_error(image, REFERENCE) == pytest.approx(1 / 64, rel=1e-6)


def test_pixels_outside_the_mask_do_not_count():
    image, mask = REFERENCE.copy(), np.ones((8, 8), bool)
    image[3, 3], mask[3, 3] = 99.0, False
    assert relative_rmse(image, REFERENCE, mask) == 0.0


def test_a_black_reference_is_not_a_division_by_zero():
    black = np.zeros_like(REFERENCE)
    assert relative_rmse(black, black) == 0.0
    assert relative_rmse(REFERENCE, black) == np.inf


def test_point_error_of_a_dim_point_is_measured_against_a_tenth_of_the_mean():
    reference = np.array([0.0, 2.0])
    assert point_error(np.array([0.1, 2.0]), reference) == pytest.approx([1.0, 0.0])
    assert point_error(np.array([1.1, 0.01, 0.0]), np.array([1.0, 0.0, 2.0])) == pytest.approx([0.1, 0.1, 1.0])


def test_neither_the_dark_nor_nothing_errs():
    assert point_error(np.zeros(2), np.zeros(2)).tolist() == [0.0, 0.0]
    assert point_error(np.zeros(0), np.zeros(0)).tolist() == []


def test_flip_is_zero_for_equal_and_large_for_opposite_pictures():
    black, white = np.zeros((16, 16, 3), np.float32), np.ones((16, 16, 3), np.float32)
    assert flip(white, white)[0] == 0.0
    assert flip(black, white)[0] > 0.8


def test_pictures_of_different_size_are_refused():
    with pytest.raises(InvalidInput, match="render both alike"):
        relative_rmse(REFERENCE, REFERENCE[:4])


def test_similarity_is_the_corrected_algorithm_1() -> None:
    """Seed 000: components of 200 and 100 are about half alike, whichever is which."""
    bright, dark = np.full((2, 3, 3), 200, np.uint8), np.full((2, 3, 3), 100, np.uint8)
    assert similarity(bright, dark) == similarity(dark, bright) == pytest.approx(101 / 201)
    assert similarity(bright, bright) == 1.0
    assert similarity(np.zeros_like(bright), np.full_like(bright, 255)) == pytest.approx(1 / 256)
    mixed = bright.copy()
    mixed[0] = 100
    assert similarity(mixed, bright) == pytest.approx(0.5 * (1 + 101 / 201))


def test_similarity_compares_pictures_of_8_bits_and_one_size() -> None:
    picture = np.zeros((2, 2, 3), np.uint8)
    with pytest.raises(InvalidInput, match="8 bits"):
        similarity(picture, picture.astype(np.float32))  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="sizes"):
        similarity(picture, picture[:1])


@pytest.mark.parametrize(
    ("frame_rate", "percent", "published"),
    [
        *((681, 91.847, 76.7816), (161, 98.563, 73.7648), (87, 99.475, 60.9524), (106, 98.853, 44.4638)),
        *((681, 84.426, 40.1952), (84, 97.956, 14.1879), (78, 91.591, 2.7352), (133, 99.483, 150.8704)),
    ],
)
def test_rank_values_are_those_of_table_5_10(frame_rate: float, percent: float, published: float) -> None:
    assert rank_value(frame_rate, 55, percent / 100) == pytest.approx(published, abs=1e-4)


def test_rank_value_without_loss() -> None:
    assert rank_value(55, 55, 1.0) == 0.0
    assert rank_value(60, 55, 1.0) == np.inf
    assert rank_value(50, 55, 1.0) == -np.inf
