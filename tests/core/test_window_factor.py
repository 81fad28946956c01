# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows grow where the error model of clusters says too little, so that a tolerance holds there as well."""

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import mesh_of
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_grid import GridSettings, LightGrid
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.light_scale import PROBES, mean_irradiance
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.light_tree_error import PointErrors, tree_errors
from vlm_addon.core.surface_points import NO_POINTS, SurfacePoints, random_surface_points
from vlm_addon.core.window_factor import window_factor

JUDGED = 400


def cuboid(length: float, width: float, height: float, per_metre: float) -> np.ndarray:
    """Triangles of a room's walls, facing inwards."""
    size = np.array([length, width, height])
    walls = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        counts = [max(1, round(size[i] * per_metre)) for i in (u, v)]
        i, j = (values.ravel() for values in np.indices(counts))
        for side in (0.0, size[axis]):
            ring = np.zeros((len(i), 4, 3))
            ring[:, :, axis] = side
            for corner, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
                ring[:, corner, u] = (i + a) * size[u] / counts[0]
                ring[:, corner, v] = (j + b) * size[v] / counts[1]
            if side:
                ring = ring[:, ::-1]
            walls += [ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]
    return np.concatenate(walls)


def soup(count: int) -> np.ndarray:
    """Triangles of all sizes and directions, through each other."""
    random = np.random.default_rng(5)
    return random.random((count, 1, 3)) * 6.0 + random.normal(0.0, 0.15, (count, 3, 3))


def points_of(corners: np.ndarray, count: int, seed: int) -> SurfacePoints:
    mesh = mesh_of(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return random_surface_points([mesh], count, seed)


def errors_of(corners: np.ndarray, tolerance: float, factor: float) -> PointErrors:
    """Under even light, against the sum over all lights."""
    lights, probes = lights_from_triangles(corners), points_of(corners, PROBES, 0)
    radiosity, tree = np.ones((len(lights), 3)), build_light_tree(lights)
    mean = mean_irradiance([tree], lights, radiosity, probes)
    clusters = light_clusters(tree, lights, radiosity, tolerance, mean, factor)
    points = points_of(corners, JUDGED, 1)
    return tree_errors([(tree, clusters)], lights, radiosity, points.positions, points.normals, points.tag_ids)


def factor_of(corners: np.ndarray, tolerance: float) -> float:
    lights = lights_from_triangles(corners)
    return window_factor([build_light_tree(lights)], lights, tolerance, points_of(corners, PROBES, 0))


@pytest.mark.parametrize(
    ("corners", "tolerance"), [(cuboid(30.0, 2.0, 2.5, 2.0), 0.02), (soup(800), 0.01)], ids=["corridor", "soup"]
)
def test_a_tolerance_holds_where_the_model_alone_says_too_little(corners: np.ndarray, tolerance: float) -> None:
    assert not errors_of(corners, tolerance, 1.0).within(tolerance)
    factor = factor_of(corners, tolerance)
    assert factor > 1.0
    assert errors_of(corners, tolerance, factor).within(tolerance)


def test_windows_of_a_room_stay_as_they_are() -> None:
    assert factor_of(cuboid(4.0, 3.0, 3.0, 3.0), 0.02) == 1.0


def test_without_probes_or_lights_windows_stay_as_they_are() -> None:
    lights = lights_from_triangles(soup(50))
    assert window_factor([build_light_tree(lights)], lights, 0.02, NO_POINTS) == 1.0
    assert window_factor([], lights, 0.02, points_of(soup(50), PROBES, 0)) == 1.0


def moving(lights: VirtualLightMesh, first: int, step: float) -> VirtualLightMesh:
    """Lights of which those from `first` on have moved."""
    dynamic = np.arange(len(lights)) >= first
    moved = lights.corners + step * dynamic[:, None, None]
    return replace(lights, vertices=moved.reshape(-1, 3), dynamic=dynamic)


def test_neither_other_light_nor_what_moves_changes_a_grids_windows() -> None:
    corners = cuboid(30.0, 2.0, 2.5, 2.0)
    # The light mesh has each corner of its own, so that lights can be moved alone.
    lights = lights_from_triangles(corners)
    assert len(lights.vertices) == 3 * len(lights)
    first = len(lights) - 20
    bounds = (corners.min(axis=(0, 1)), corners.max(axis=(0, 1)))
    probes = points_of(corners, PROBES, 0)
    grid = LightGrid.bake(moving(lights, first, 0.0), bounds, GridSettings(tolerance=0.02), probes=probes)
    assert grid.window_factor > 1.0
    lamp = np.exp(-((lights.corners.mean(axis=1)[:, :1] - 7.0) ** 2)) * np.ones((1, 3))
    assert grid.relit(moving(lights, first, 0.0), lamp).window_factor == grid.window_factor
    assert grid.moved(moving(lights, first, 0.1)).window_factor == grid.window_factor
