# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights reach the back of their region by a short way."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.surface_shapes import grid, sheet
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.least_push import least_push
from vlm_addon.core.mesh_topology import Rows
from vlm_addon.core.placement import intrusions, place_behind
from vlm_addon.core.progress import step

LIGHT = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ONE = np.array([[0, 1, 2]])


def speck(x: float, y: float, depth: float) -> np.ndarray:
    """A source triangle of no size below the light."""
    return np.full((1, 3, 3), [x, y, -depth])


def only(count: int) -> Rows:
    return Rows(np.arange(count), np.array([0, count]))


def test_point_below_a_vertex_moves_that_vertex_alone() -> None:
    moved = least_push(LIGHT, ONE, only(1), speck(1.0, 0.0, 0.1), np.zeros(1))
    np.testing.assert_allclose(moved, [[0, 0, 0], [0, 0, -0.1], [0, 0, 0]], atol=1e-9)


def test_point_below_the_middle_moves_all_alike() -> None:
    moved = least_push(LIGHT, ONE, only(1), speck(1 / 3, 1 / 3, 0.1), np.zeros(1))
    np.testing.assert_allclose(moved, np.broadcast_to([0, 0, -0.1], (3, 3)), atol=1e-9)


def test_light_behind_its_region_or_spared_stays_to_the_bit() -> None:
    for depth in (-0.1, 0.0, 0.01):
        assert not least_push(LIGHT, ONE, only(1), speck(0.3, 0.3, depth), np.full(1, 0.02)).any()


def test_light_without_a_region_stays() -> None:
    assert not least_push(LIGHT, ONE, Rows(np.zeros(0, np.int64), np.zeros(2, np.int64)), LIGHT[None], np.ones(1)).any()


def test_wavy_sheet_is_cleared_with_less_depth_than_the_deepest_of_each_light() -> None:
    fine, triangles = sheet(lambda x, y: 0.05 * np.sin(9 * x) * np.cos(7 * y), 40, 40)
    coarse, lights = grid(5, 5)
    coarse = coarse + np.array([0, 0, 1]) * (0.05 * np.sin(9 * coarse[:, :1]) * np.cos(7 * coarse[:, 1:2]))
    source = fine[triangles]
    centre = source.mean(axis=1)
    corners = coarse[lights]
    nearest = ((corners.mean(axis=1)[None, :, :2] - centre[:, None, :2]) ** 2).sum(axis=2).argmin(axis=1)
    order = np.argsort(nearest, kind="stable")
    regions = Rows(order, np.searchsorted(nearest[order], np.arange(len(lights) + 1)))
    before = intrusions(corners, regions, source)
    moved = least_push(coarse, lights, regions, source, np.zeros(len(lights)))
    after = intrusions((coarse + moved)[lights], regions, source)
    assert after.max() < 0.3 * before.max()
    # What each light asks for alone, every vertex as deep as the deepest of its lights, is deeper in the mean.
    whole = np.zeros(len(coarse))
    np.maximum.at(whole, lights.ravel(), np.repeat(np.maximum(before, 0.0), 3))
    assert np.linalg.norm(moved, axis=1).mean() < 0.8 * whole.mean()


def test_progress_may_stop_placement() -> None:
    with pytest.raises(Cancelled):
        place_behind(LIGHT, ONE, only(1), speck(0.3, 0.3, 0.1), lambda share: step(lambda *_: False, share, "place"))
