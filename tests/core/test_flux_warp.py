# SPDX-License-Identifier: GPL-3.0-or-later
"""Warped points: as dense as the importance says, spread as the points were, and never where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.flux_warp import choose_parts, importance_pyramid, warp_points
from vlm_addon.core.halton import halton_points
from vlm_addon.core.scene import Float64

LEVELS = 4
SIDE = 1 << (LEVELS - 1)
FACES = [(1, 1), (2, 3)]
"""Rows and columns: a map of one view, and of a cube."""
LAST = float(np.nextafter(1.0, 0.0))
IMPORTANCES = st.one_of(st.just(0.0), st.floats(1e-12, 1e12))
COORDINATES = st.one_of(st.sampled_from([0.0, 0.5, LAST]), st.floats(0.0, 1.0, exclude_max=True))


def random_map(faces: tuple[int, int], seed: int = 0, black: float = 0.5) -> Float64:
    """Importance over nine powers of ten, with a share of black texels."""
    random = np.random.default_rng(seed)
    shape = faces[0] * SIDE, faces[1] * SIDE
    return np.where(random.random(shape) < black, 0.0, 10.0 ** random.uniform(-9.0, 0.0, shape))


def even_grid(count: int) -> Float64:
    """(count², 2) middles of equal squares."""
    middles = (np.arange(count) + 0.5) / count
    return np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("faces", FACES)
@pytest.mark.parametrize("seed", range(4))
def test_each_texel_gets_its_share_of_the_unit_square(faces: tuple[int, int], seed: int) -> None:
    """What is sent to a texel is a rectangle, so an even grid fills it but for a row and a column at its edges."""
    importance, count = random_map(faces, seed), 128
    found = warp_points(importance_pyramid(importance, LEVELS), even_grid(count))
    filled = np.zeros(importance.shape)
    np.add.at(filled, (found.texels[:, 1], found.texels[:, 0]), 1.0 / count**2)
    np.testing.assert_allclose(filled, importance / importance.sum(), atol=2.0 / count)
    assert (filled[importance == 0.0] == 0.0).all()


@pytest.mark.parametrize("faces", FACES)
def test_probabilities_are_shares_of_the_importance(faces: tuple[int, int]) -> None:
    importance = random_map(faces)
    found = warp_points(importance_pyramid(importance, LEVELS), halton_points(500))
    expected = importance[found.texels[:, 1], found.texels[:, 0]] / importance.sum()
    np.testing.assert_allclose(found.probabilities, expected, rtol=1e-12)


@pytest.mark.parametrize("faces", FACES)
def test_even_importance_leaves_the_points_where_they_are(faces: tuple[int, int]) -> None:
    size = np.array(faces[::-1]) * SIDE
    points = np.random.default_rng(2).random((1000, 2))
    found = warp_points(importance_pyramid(np.ones(size[::-1]), LEVELS), points)
    np.testing.assert_array_equal(found.texels, (points * size).astype(int))


def test_halton_points_stay_as_even_as_they_are() -> None:
    """Every run of 2^4 3^3 of them has as many in each quarter of the map as its light says, to the last one."""
    weights = np.array([[1.0, 1.0], [2.0, 2.0]])
    importance = np.kron(weights, np.ones((SIDE // 2, SIDE // 2)))
    count = 2**4 * 3**3
    for first in (1, 100, 12345):
        found = warp_points(importance_pyramid(importance, LEVELS), halton_points(count, first))
        quarters = found.texels // (SIDE // 2)
        filled = np.zeros((2, 2))
        np.add.at(filled, (quarters[:, 1], quarters[:, 0]), 1)
        np.testing.assert_array_equal(filled, weights / weights.sum() * count)


@given(
    arrays.arrays(np.float64, (SIDE, SIDE), elements=IMPORTANCES).filter(lambda values: values.any()),
    st.lists(st.tuples(COORDINATES, COORDINATES), min_size=1, max_size=20),
)
def test_no_black_texel_is_ever_chosen(importance: Float64, points: list[tuple[float, float]]) -> None:
    found = warp_points(importance_pyramid(importance, LEVELS), np.array(points))
    assert (importance[found.texels[:, 1], found.texels[:, 0]] > 0.0).all()
    assert (found.probabilities > 0.0).all()


@given(
    arrays.arrays(np.float64, st.integers(1, 9), elements=IMPORTANCES).filter(lambda values: values.any()),
    COORDINATES,
)
def test_a_part_holds_its_coordinate_and_says_where(weights: Float64, coordinate: float) -> None:
    found = choose_parts(weights, np.array([coordinate]))
    part, place = int(found.parts[0]), float(found.stretched[0])
    assert weights[part] > 0.0
    assert 0.0 <= place < 1.0
    back = (weights[:part].sum() + place * weights[part]) / weights.sum()
    assert back == pytest.approx(coordinate, abs=1e-12)


@pytest.mark.parametrize("weights", [[0.0, 0.0], [1.0, -1.0], [1.0, np.nan], [np.inf, 1.0]])
def test_weights_that_no_point_can_follow_are_refused(weights: list[float]) -> None:
    with pytest.raises(InvalidInput, match="weights"):
        choose_parts(np.array(weights), np.array([0.5]))


@pytest.mark.parametrize("faces", FACES)
def test_every_level_of_the_pyramid_holds_all(faces: tuple[int, int]) -> None:
    pyramid = importance_pyramid(random_map(faces), LEVELS)
    assert [level.shape for level in pyramid] == [(faces[0] << i, faces[1] << i) for i in range(LEVELS)][::-1]
    for level in pyramid:
        assert level.sum() == pytest.approx(pyramid[0].sum(), rel=1e-12)
