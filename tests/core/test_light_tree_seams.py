# SPDX-License-Identifier: GPL-3.0-or-later
"""The faces of cells do not show in tolerance mode, at any level of the tree's own cells; the test can see them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import room
from tests.render.rooms import lights_from_triangles
from tests.seams import Steps, steps_along
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.light_tree_error import full_irradiance
from vlm_addon.core.scene import Float64

SAMPLES = 5000
LINES = (((0.02, 0.31, 0.0), (0.98, 0.36, 0.0)), ((0.1, 0.07, 0.0), (0.83, 0.94, 0.0)))
UP = np.tile((0.0, 0.0, 1.0), (SAMPLES, 1))
TAGS = np.zeros(SAMPLES, np.int32)


@pytest.fixture(scope="module")
def lights() -> VirtualLightMesh:
    """A box of metre size, its lights a little behind its walls."""
    return lights_from_triangles(0.5 + 1.02 * (room(6) - 0.5))


def radiosity_of(lights: VirtualLightMesh, lamp: bool) -> Float64:
    centroids = lights.corners.mean(axis=1)
    if lamp:
        return np.maximum(1.0 - np.linalg.norm(centroids - (1.0, 0.4, 0.3), axis=1) / 0.3, 0.0)[:, None] * np.ones(3)
    return (1.0 + 0.5 * np.sin(centroids @ [3.0, 2.0, 4.0]))[:, None] * np.ones(3)


def line(ends: tuple[tuple[float, ...], tuple[float, ...]]) -> Float64:
    start, end = np.array(ends)
    return start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - start)


def steps_at(values: Float64, points: Float64, origin: Float64, cell: float) -> Steps:
    return steps_along(values, np.floor((points - origin) / cell).astype(int))


@pytest.mark.parametrize("lamp", [False, True])
@pytest.mark.parametrize("tolerance", [0.01, 0.02, 0.05, 0.1])
def test_no_face_shows(lights: VirtualLightMesh, tolerance: float, lamp: bool) -> None:
    tree, radiosity = build_light_tree(lights), radiosity_of(lights, lamp)
    clusters = light_clusters(tree, lights, radiosity, tolerance)
    for ends in LINES[:1] if lamp else LINES:
        points = line(ends)
        values = cut_irradiance(tree, clusters, lights, radiosity, points, UP, TAGS).irradiance.sum(axis=1)
        for level in np.unique(tree.level):
            cell = tree.cell_size * 2.0**level
            if cell < 0.9:
                assert not steps_at(values, points, tree.cell_origin, cell).seam


def test_lights_cut_off_at_a_distance_of_the_cell_show(lights: VirtualLightMesh) -> None:
    """Range mode: a light counts in the cells that its range reaches."""
    radiosity, points = radiosity_of(lights, False), line(LINES[0])
    cells = np.floor(points / 0.1).astype(int)
    centroids = lights.corners.mean(axis=1)
    smooth = full_irradiance(lights, radiosity, points, UP, TAGS).sum(axis=1)
    assert not steps_at(smooth, points, np.zeros(3), 0.1).seam
    values = np.zeros(SAMPLES)
    for cell in np.unique(cells, axis=0):
        at = (cells == cell).all(axis=1)
        reached = np.linalg.norm(centroids - 0.1 * (cell + 0.5), axis=1) < 0.5
        count = int(at.sum())
        found = full_irradiance(lights, radiosity * reached[:, None], points[at], UP[:count], TAGS[:count])
        values[at] = found.sum(axis=1)
    assert steps_at(values, points, np.zeros(3), 0.1).seam
