# SPDX-License-Identifier: GPL-3.0-or-later
"""Halton points in cones against trying every point of the sphere, and budgets against what shares must be."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vlm_addon.core.halton import halton_points
from vlm_addon.core.scene import Float64
from vlm_addon.core.vpl_placement import Accepts, ConePoints, share_out, sphere_directions


def cone(cos_half: float) -> Accepts:
    return lambda directions: -directions[:, 2] >= cos_half


def tried_all(accepts: Accepts, count: int) -> Float64:
    """The first `count` of 200,000 points on the whole sphere."""
    directions = sphere_directions(halton_points(200_000))
    return directions[accepts(directions)][:count]


def test_directions_are_unit_and_even_over_the_sphere() -> None:
    directions = sphere_directions(halton_points(5000))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(directions.mean(axis=0), 0.0, atol=2e-3)
    np.testing.assert_allclose(directions.T @ directions / 5000, np.eye(3) / 3.0, atol=2e-3)


def test_first_direction_is_that_of_the_published_formula() -> None:
    """phi = 2 pi / 2, delta = arcsin(2 / 3 - 1)."""
    delta = np.arcsin(2.0 / 3.0 - 1.0)
    expected = [np.sin(np.pi) * np.cos(delta), np.cos(np.pi) * np.cos(delta), np.sin(delta)]
    np.testing.assert_allclose(sphere_directions(halton_points(1))[0], expected, atol=1e-12)


@pytest.mark.parametrize("degrees", [180.0, 120.0, 70.5, 60.0, 25.0, 6.0])
def test_points_in_a_cone_are_those_that_trying_all_of_the_sphere_gives(degrees: float) -> None:
    accepts = cone(np.cos(np.radians(degrees)))
    points = ConePoints(np.cos(np.radians(degrees)), accepts)
    runs = [points.take(count) for count in (1, 30, 69)]
    assert [len(run) for run in runs] == [1, 30, 69]
    np.testing.assert_array_equal(np.concatenate(runs), tried_all(accepts, 100))


@pytest.mark.parametrize("degrees", [170.0, 45.0, 5.0, 0.01])
def test_solid_angle_is_that_of_the_cone(degrees: float) -> None:
    cos_half = np.cos(np.radians(degrees))
    points = ConePoints(cos_half, cone(cos_half))
    points.take(500)
    assert points.solid_angle == pytest.approx(2.0 * np.pi * 2.0 * np.sin(np.radians(degrees) / 2) ** 2, rel=0.01)


def test_a_cone_that_takes_nothing_ends() -> None:
    points = ConePoints(-1.0, lambda directions: np.zeros(len(directions), bool))
    assert points.take(10).shape == (0, 3)
    assert points.solid_angle == 0.0


def test_sequences_from_elsewhere_have_other_points() -> None:
    first, later = (ConePoints(-1.0, cone(-1.0), start).take(50) for start in (1, 51))
    np.testing.assert_array_equal(later, tried_all(cone(-1.0), 100)[50:])
    assert not (first == later).all(axis=1).any()


@given(st.integers(0, 500), st.lists(st.floats(0.0, 1e6), min_size=1, max_size=12))
def test_shares_add_up_and_none_with_weight_goes_without(count: int, weights: list[float]) -> None:
    values = np.array(weights)
    given_out = np.array(share_out(count, values))
    assert (given_out >= 0).all()
    assert given_out.sum() == (count if values.sum() > 0.0 else 0)
    assert not given_out[values == 0.0].any()
    if count >= (values > 0.0).sum():
        assert (given_out[values > 0.0] >= 1).all()
        assert (np.diff(given_out[np.argsort(values, kind="stable")]) >= -1).all()


def test_shares_follow_weights() -> None:
    parts: npt.ArrayLike = share_out(1000, np.array([1.0, 2.0, 7.0]))
    assert parts == [100, 200, 700]
    assert share_out(3, np.array([5.0, 1.0, 1.0, 1.0])) == [2, 1, 0, 0]
    assert share_out(10, np.array([1e9, 1.0])) == [9, 1]
