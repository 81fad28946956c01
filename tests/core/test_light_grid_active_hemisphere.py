# SPDX-License-Identifier: GPL-3.0-or-later
"""The overlap of half balls and boxes against exact rational arithmetic on every face, edge and corner of the box."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vlm_addon.core.active_hemisphere import HalfBalls, make_half_balls, overlaps


def least_distance_squared(normal, low, high):
    """Of the points x in the box with normal x >= 0, the least |x|², as a Fraction; None where there is no such point.

    The nearest point lies within some face of the box (of dimension 0 to 3), in the plane or not; within it, it is the
    foot of the perpendicular.
    """
    normal, low, high = ([Fraction(float(value)) for value in values] for values in (normal, low, high))
    feasible = []
    for sides in itertools.product(("low", "high", "free"), repeat=3):
        fixed = {i: (low if side == "low" else high)[i] for i, side in enumerate(sides) if side != "free"}
        free = [i for i in range(3) if i not in fixed]
        feet = [{**fixed, **dict.fromkeys(free, Fraction(0))}]
        squared = sum(normal[i] ** 2 for i in free)
        if squared:
            offset = sum(normal[i] * fixed[i] for i in fixed)
            feet.append({**fixed, **{i: -offset / squared * normal[i] for i in free}})
        for foot in feet:
            in_box = all(low[i] <= foot[i] <= high[i] for i in range(3))
            if in_box and sum(normal[i] * foot[i] for i in range(3)) >= 0:
                feasible.append(sum(foot[i] ** 2 for i in range(3)))
    return min(feasible, default=None)


def one(centre, normal, radius_squared, dtype=np.float64):
    """One half ball as given, nothing rounded."""
    normal = np.asarray(normal, dtype)
    inverse = np.full(3, 2.0**40, dtype)
    np.divide(1.0, normal, out=inverse, where=normal != 0.0)
    return HalfBalls(
        np.asarray(centre, dtype)[:, None], normal[:, None], inverse[:, None], np.array([radius_squared], dtype)
    )


def reaches(half_ball, low, high):
    dtype = half_ball.radii_squared.dtype
    return bool(overlaps(half_ball, np.asarray(low, dtype)[:, None], np.asarray(high, dtype)[:, None])[0])


coordinate = st.integers(-6, 6)
# 1 / n is exact for these, so every step of the test is.
exact_normal = st.tuples(*[st.sampled_from([-4, -2, -1, -0.5, 0, 0.5, 1, 2, 4])] * 3).filter(any)


@settings(max_examples=500, deadline=None)
@given(exact_normal, st.tuples(*[coordinate] * 3), st.tuples(*[st.integers(0, 5)] * 3), st.integers(0, 60))
@example((0, 0, 1), (0, 0, -2), (1, 1, 2), 0)
@example((1, 1, 1), (-2, -2, 3), (1, 1, 1), 8)
@example((0, 1, 0), (-1, -1, -1), (2, 0, 2), 9)
def test_exact_where_arithmetic_is_exact(normal, low, size, radius_squared):
    high = tuple(a + b for a, b in zip(low, size, strict=True))
    least = least_distance_squared(normal, low, high)
    expected = least is not None and least <= radius_squared
    for dtype in (np.float32, np.float64):
        assert reaches(one((0, 0, 0), normal, radius_squared, dtype), low, high) == expected


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1))
@pytest.mark.parametrize(("dtype", "doubt"), [(np.float64, 1e-13), (np.float32, 1e-5)])
def test_right_but_for_rounding(dtype, doubt, seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3) * 10.0 ** rng.uniform(-3, 0, 3)
    normal /= np.linalg.norm(normal)
    low = rng.normal(size=3)
    high = low + rng.exponential(size=3)
    least = least_distance_squared(normal.astype(dtype), low.astype(dtype), high.astype(dtype))
    if least is None:
        assert not reaches(one(np.zeros(3), normal, 1e6, dtype), low, high)
        return
    for share in (0.0, 0.5, 1.0 - doubt, 1.0 + doubt, 2.0):
        room = float(least) * share + (share - 1.0) * doubt
        expected = share > 1.0
        assert reaches(one(np.zeros(3), normal, room, dtype), low, high) == expected


def test_a_centre_inside_reaches_even_with_radius_zero():
    assert reaches(one((0, 0, 0), (0, 0, 1), 0.0), (-1, -1, -1), (1, 1, 1))
    assert reaches(one((0, 0, 0), (0, 0, 1), 0.0), (0, 0, 0), (1, 1, 1))
    assert not reaches(one((0, 0, 0), (0, 0, 1), 0.0), (1e-3, 0, 0), (1, 1, 1))


def test_the_flat_side_is_closed():
    assert reaches(one((0, 0, 0), (0, 0, 1), 1.0), (-1, -1, -1), (1, 1, 0))
    assert not reaches(one((0, 0, 0), (0, 0, 1), 1.0), (-1, -1, -1), (1, 1, -1e-9))


def test_ball_and_half_space_reach_but_not_together():
    # The near corner is in the ball but behind the plane; the far corner is in front of it but out of the ball.
    assert not reaches(one((0, 0, 0), (-0.6, 0, 0.8), 1.0), (0.9, -0.1, -0.1), (3.0, 0.1, 0.5))


def test_a_negative_radius_reaches_nothing():
    none = make_half_balls(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([-1.0]))
    assert not reaches(none, (-1, -1, -1), (1, 1, 1))


def test_components_that_a_device_would_flush_become_zero():
    made = make_half_balls(np.array([[1e-30, 0.25, 0.0]]), np.array([[1e-30, 1.0, -1e-9]]), np.array([1e-25]))
    assert made.centres[:, 0].tolist() == [0.0, 0.25, 0.0]
    assert made.normals[:, 0].tolist() == [0.0, 1.0, 0.0]
    assert made.inverse_normals[:, 0].tolist() == [2.0**40, 1.0, 2.0**40]
    assert made.radii_squared.tolist() == [0.0]
