# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxels are as fine as dense meshes in wide scenes need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import quad, split
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import Mesh
from vlm_addon.core.voxel_fit import MOST_IN_A_VOXEL, fitting_resolution, most_in_a_voxel

BOUNDS = np.array([-50.0, -50.0, 0.0]), np.array([50.0, 50.0, 1.0])


def patch(side: float, times: int) -> Mesh:
    """2 * 4^times triangles on a square of `side` metres."""
    square = quad((0.0, 0.0, 0.5), (side, 0.0, 0.0), (0.0, side, 0.0))
    corners = split(square.positions[square.triangles], times)
    triangles = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return replace(square, positions=corners.reshape(-1, 3), triangles=triangles)


def test_the_fullest_voxel_counts() -> None:
    places = np.array([[0.1, 0.2, 0.3], [0.9, 0.9, 0.9], [1.1, 0.5, 0.5], [-0.1, 0.5, 0.5]])
    assert most_in_a_voxel(places) == 2


@pytest.mark.parametrize(("side", "times", "expected"), [(50.0, 5, 32), (1.0, 3, 32), (4.0, 6, 128), (1e-3, 5, 1024)])
def test_voxels_are_as_fine_as_the_densest_mesh_needs(side: float, times: int, expected: int) -> None:
    floor = quad((-50.0, -50.0, 0.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0))
    found = fitting_resolution([floor, patch(side, times)], BOUNDS, 32)
    assert found == expected
    assert 2 * 4**times > MOST_IN_A_VOXEL or found == 32


def test_what_is_asked_for_is_the_least() -> None:
    assert fitting_resolution([patch(50.0, 2)], BOUNDS, 512) == 512
    assert fitting_resolution([], BOUNDS, 64) == 64


def test_a_resolution_that_there_is_not_is_refused() -> None:
    with pytest.raises(InvalidInput, match="100 voxels"):
        fitting_resolution([], BOUNDS, 100)
