# SPDX-License-Identifier: GPL-3.0-or-later
"""Random points of surfaces lie on them, in proportion to area."""

import numpy as np

from tests.core.surface_shapes import mesh_of
from vlm_addon.core.surface_points import random_surface_points

COUNT = 20_000
# A square of 1 m² at z = 0 in two halves, and a triangle of 3 m² at z = 2 that faces down.
SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float64)
BELOW = np.array([[[0, 0, 2], [0, 2, 2], [3, 0, 2]]], np.float64)


def surface(corners, tag_id=0):
    return mesh_of(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), tags=tag_id)


def test_points_lie_on_their_surface_and_have_its_normal_and_tag():
    points = random_surface_points([surface(SQUARE, tag_id=3), surface(BELOW, tag_id=5)], COUNT)
    up = points.tag_ids == 3
    assert set(points.tag_ids) == {3, 5}
    assert (points.positions[up, 2] == 0.0).all()
    assert np.allclose(points.positions[~up, 2], 2.0, atol=1e-15)
    assert (points.normals[:, 2] == np.where(up, 1.0, -1.0)).all()


def test_points_are_uniform_over_area():
    points = random_surface_points([surface(SQUARE), surface(BELOW)], COUNT).positions
    low = points[:, 2] < 1.0
    assert abs(low.mean() - 0.25) < 0.015
    assert np.allclose(points[low].mean(axis=0), [0.5, 0.5, 0.0], atol=0.02)


def test_the_same_seed_gives_the_same_points():
    first, again, other = (random_surface_points([surface(SQUARE)], 10, seed).positions for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


def test_surfaces_without_area_have_no_points():
    assert len(random_surface_points([], 5).positions) == 0
    assert len(random_surface_points([surface(0.0 * SQUARE)], 5).positions) == 0
