# SPDX-License-Identifier: GPL-3.0-or-later
"""Equirectangular maps: directions, solid angles, looking up and resizing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vlm_addon.core.environment import (
    map_directions,
    map_places,
    map_solid_angles,
    radiance_at,
    radiance_towards,
    require_usable_environment,
    resized_map,
)
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import Environment

SIDES = st.integers(1, 40)


def random_map(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.0, 3.0, (height, width, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("u", "v", "direction"),
    [
        (0.5, 0.5, (1, 0, 0)),
        (0.25, 0.5, (0, 1, 0)),
        (0.75, 0.5, (0, -1, 0)),
        (0.5, 0.75, (math.sqrt(0.5), 0, math.sqrt(0.5))),
    ],
)
def test_places_are_blenders(u: float, v: float, direction: tuple[float, float, float]) -> None:
    assert map_places(3.0 * np.array(direction)) == pytest.approx([u, v])


@pytest.mark.parametrize(("z", "v"), [(1.0, 1.0), (-1.0, 0.0)])
def test_up_is_the_top_and_down_the_bottom(z: float, v: float) -> None:
    assert map_places(np.array([0.0, 0.0, z]))[1] == pytest.approx(v)


@given(SIDES, SIDES)
def test_directions_of_texels_are_at_their_places(height: int, width: int) -> None:
    directions = map_directions(height, width)
    assert np.linalg.norm(directions, axis=2) == pytest.approx(1.0)
    u, v = np.moveaxis(map_places(directions), -1, 0)
    assert v == pytest.approx(np.broadcast_to(((np.arange(height) + 0.5) / height)[:, None], (height, width)))
    assert u == pytest.approx(np.broadcast_to((np.arange(width) + 0.5) / width, (height, width)))


@given(SIDES, SIDES)
def test_texels_cover_the_sphere(height: int, width: int) -> None:
    assert map_solid_angles(height, width).sum() * width == pytest.approx(4.0 * math.pi)


def test_a_texel_covers_what_its_edges_enclose() -> None:
    """Between two elevations and two azimuths: difference of the sines times that of the azimuths."""
    assert map_solid_angles(3, 8)[1] == pytest.approx(2.0 * math.sin(math.pi / 6) * math.pi / 4)


def test_between_two_texels_is_their_mean_also_around_the_side() -> None:
    found = random_map(4, 6)
    between = np.array([[1.0 / 6, 0.125], [0.0, 0.125], [1.0, 0.125], [0.5 / 6, 0.25]])
    wanted = [
        0.5 * (found[0, 0] + found[0, 1]),
        0.5 * (found[0, 5] + found[0, 0]),
        0.5 * (found[0, 5] + found[0, 0]),
        0.5 * (found[0, 0] + found[1, 0]),
    ]
    assert radiance_at(found, between) == pytest.approx(np.array(wanted))


def test_beyond_the_last_rows_a_map_goes_on_as_they_are() -> None:
    found = random_map(4, 1)
    assert radiance_at(found, np.array([[0.5, 0.0], [0.5, 1.0]])) == pytest.approx(found[[0, 3], 0])


def test_a_turned_map_is_looked_up_where_it_was_turned_to() -> None:
    """By 90 degrees about z: what the map has at +x comes from where the matrix takes +x to from."""
    radiance = random_map(8, 16)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = radiance_towards(Environment("e", radiance, turn), np.array([0.0, -1.0, 0.0]))
    assert found == pytest.approx(radiance_at(radiance, map_places(np.array([1.0, 0.0, 0.0]))))


@given(SIDES, SIDES, SIDES, SIDES)
def test_resizing_keeps_the_integral(height: int, width: int, new_height: int, new_width: int) -> None:
    values = random_map(height, width)
    resized = resized_map(values, new_height, new_width)
    before = map_solid_angles(height, width) @ values.sum(axis=1)
    after = map_solid_angles(new_height, new_width) @ resized.sum(axis=1)
    assert after == pytest.approx(before)
    assert values.min() - 1e-6 <= resized.min()
    assert resized.max() <= values.max() + 1e-6


def test_resizing_by_whole_blocks_is_their_mean() -> None:
    values = random_map(6, 8)
    weights = map_solid_angles(6, 8)[:, None]
    rows = (values * weights[..., None]).reshape(3, 2, 8, 3).sum(axis=1) / weights.reshape(3, 2, 1, 1).sum(axis=1)
    assert resized_map(values, 3, 4) == pytest.approx(rows.reshape(3, 4, 2, 3).mean(axis=2))


def test_a_map_of_many_rows_is_resized_as_one() -> None:
    """It is read in blocks of rows."""
    values = random_map(1000, 4)
    twice = resized_map(resized_map(values, 500, 4), 250, 4)
    assert resized_map(values, 250, 4) == pytest.approx(twice, rel=1e-6)


@pytest.mark.parametrize(
    ("radiance", "matrix", "problem"),
    [
        (np.zeros((2, 4)), np.eye(3), "shape"),
        (np.zeros((0, 4, 3)), np.eye(3), "shape"),
        (np.full((2, 4, 3), np.nan), np.eye(3), "not finite"),
        (np.full((2, 4, 3), np.inf), np.eye(3), "not finite"),
        (np.full((2, 4, 3), -1.0), np.eye(3), "below 0"),
        (np.ones((2, 4, 3)), 2.0 * np.eye(3), "rotation"),
        (np.ones((2, 4, 3)), np.full((3, 3), np.nan), "rotation"),
    ],
)
def test_what_is_no_environment_is_refused(radiance: np.ndarray, matrix: np.ndarray, problem: str) -> None:
    with pytest.raises(InvalidInput, match=f"environment 'attic'.*{problem}"):
        require_usable_environment(Environment("attic", radiance.astype(np.float32), matrix))
