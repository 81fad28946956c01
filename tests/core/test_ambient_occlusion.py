# SPDX-License-Identifier: GPL-3.0-or-later
"""Openness by rays against closed forms."""

import math

import numpy as np
import pytest

from tests.open_corner import open_beside_wall
from vlm_addon.core.ambient_occlusion import cosine_directions, openness
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.triangle_tree import build_tree

UP = np.array([0.0, 0.0, 1.0])
FLOOR = np.array([[[-9, -9, 0], [9, -9, 0], [9, 9, 0]], [[-9, -9, 0], [9, 9, 0], [-9, 9, 0]]], np.float64)
WALL = np.array([[[0, -9, 0], [0, 9, 0], [0, 9, 9]], [[0, -9, 0], [0, 9, 9], [0, -9, 9]]], np.float64)
STRATA = 32


def over_floor(tree, points, radius, normal=UP):
    places = np.atleast_2d(np.asarray(points, float))
    normals = np.tile(normal, (len(places), 1))
    return openness(tree, places, normals, np.tile(UP, (len(places), 1)), radius, STRATA)


@pytest.mark.parametrize("share", [1e-3, 0.1, 0.5, 0.9])
def test_a_wall_takes_the_segment_of_the_disc_beyond_it(share):
    found = over_floor(build_tree(np.concatenate([FLOOR, WALL])), [share * 2.0, 0.3, 0.0], 2.0)
    assert found == pytest.approx(open_beside_wall(share), abs=0.01)


def test_what_is_beyond_the_radius_takes_nothing():
    assert over_floor(build_tree(np.concatenate([FLOOR, WALL])), [2.001, 0.3, 0.0], 2.0) == 1.0


def test_under_the_triangle_nothing_is_open():
    tilted = np.array([math.sin(0.5), 0.0, math.cos(0.5)])
    found = over_floor(build_tree(FLOOR), [0.2, 0.3, 0.0], 1.0, tilted)
    assert found == pytest.approx(0.5 * (1.0 + math.cos(0.5)), abs=0.01)


def test_a_ceiling_leaves_what_is_beside_its_disc():
    ceiling = FLOOR[:, ::-1] + 0.5 * UP
    # Met at height 0.5 within a radius of 1: all directions within 60 degrees, three quarters of the disc.
    assert over_floor(build_tree(np.concatenate([FLOOR, ceiling])), [0.2, 0.3, 0.0], 1.0) == pytest.approx(
        0.25, abs=0.01
    )


def test_directions_are_as_dense_as_the_cosine():
    places = np.random.default_rng(0).random((20_000, 2))
    normal = np.array([0.48, 0.6, 0.64])
    cosines = cosine_directions(np.tile(normal, (len(places), 1)), places) @ normal
    assert cosines.min() >= 0.0
    # Squares of such cosines are uniform.
    np.testing.assert_allclose(np.quantile(cosines**2, [0.1, 0.5, 0.9]), [0.1, 0.5, 0.9], atol=0.02)


def test_a_radius_of_nothing_is_refused():
    with pytest.raises(InvalidInput, match=r"radius 0\.0 m"):
        over_floor(build_tree(FLOOR), [0.0, 0.0, 0.0], 0.0)


def test_no_points_give_no_values():
    assert openness(build_tree(FLOOR), *np.zeros((3, 0, 3)), 1.0, 2).shape == (0,)
