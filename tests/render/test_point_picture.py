# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import numpy as np

from tests.render.rooms import facing_camera
from vlm_addon.render.point_picture import palette, with_points
from vlm_addon.render.view import make_view

VIEW = make_view(facing_camera(2.0), 36, 18, np.zeros(3))
"""2 m above the origin, y up: 0.04 m a pixel in the plane through the origin."""


def test_points_show_at_their_pixel_over_what_was_there() -> None:
    points = np.array([[0.02, 0.02, 0.0], [-0.7, 0.34, 0.0], [0.02, 0.02, -1e-3]])
    colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    picture = np.full((18, 36, 3), 0.5, np.float32)
    drawn = with_points(picture, VIEW, points, colors)
    np.testing.assert_array_equal(drawn[8, 18], [0, 0, 1])
    np.testing.assert_array_equal(drawn[0, 0], [0, 1, 0])
    assert (drawn != 0.5).any(axis=2).sum() == 2
    assert (picture == 0.5).all()


def test_points_behind_and_beside_the_camera_do_not_show() -> None:
    points = np.array([[0.0, 0.0, 3.0], [5.0, 0.0, 0.0], [0.0, -5.0, 0.0]])
    drawn = with_points(np.zeros((18, 36, 3), np.float32), VIEW, points, np.ones((3, 3), np.float32))
    assert drawn.max() == 0.0


def test_groups_have_colours_of_their_own() -> None:
    colors = palette(np.array([0, 1, 2, 3, 4, 0]))
    assert len(np.unique(colors.round(6), axis=0)) == 5
    np.testing.assert_array_equal(colors[0], colors[5])
    assert palette(np.zeros(0, int)).shape == (0, 3)


def test_a_mark_colours_the_pixels_around_its_point_and_ends_with_the_picture() -> None:
    points = np.array([[0.02, 0.02, 0.0], [-0.7, 0.34, 0.0]])
    plus = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
    drawn = with_points(np.zeros((18, 36, 3), np.float32), VIEW, points, np.ones((2, 3), np.float32), plus)
    found = {(int(row), int(column)) for row, column in np.argwhere(drawn[..., 0] == 1.0)}
    assert found == {(8, 18), (7, 18), (9, 18), (8, 17), (8, 19), (0, 0), (1, 0), (0, 1)}
