# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows grow where the error model of clusters says too little, so that a tolerance holds there as well."""

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import mesh_of
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_grid import GridSettings, LightGrid
from vlm_addon.core.light_grid_error import grid_error
from vlm_addon.core.light_scale import PROBES, mean_irradiance
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.light_tree_error import full_irradiance
from vlm_addon.core.metrics import point_error, within_tolerance
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


def pavilion() -> tuple[np.ndarray, np.ndarray]:
    """A hall, open at one end, with a finely cut box in it; and radiosities: what faces the open end is lit.

    The box's face and the wall far behind it are in one cluster.
    """
    hall = cuboid(20.0, 10.0, 6.0, 1.0)
    hall = hall[~(hall[:, :, 0] == 20.0).all(axis=1)]
    box = cuboid(2.0, 2.0, 2.0, 8.0)[:, ::-1] + np.array([10.0, 4.0, 0.0])
    corners = np.concatenate([hall, box])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.maximum(normals[:, :1] / np.linalg.norm(normals, axis=1, keepdims=True), 0.0)
    return corners, facing * np.ones((1, 3))


def checkered(length: float) -> tuple[np.ndarray, np.ndarray]:
    """A room of red and blue squares, and their radiosities."""
    corners = cuboid(12.0, 8.0, 5.0, 1.5)
    squares = np.floor(corners.mean(axis=1) / length).astype(int).sum(axis=1) % 2
    return corners, np.where(squares[:, None] == 0, (0.9, 0.02, 0.02), (0.02, 0.02, 0.9))


def even(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return corners, np.ones((len(corners), 3))


def points_of(corners: np.ndarray, count: int, seed: int) -> SurfacePoints:
    mesh = mesh_of(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return random_surface_points([mesh], count, seed)


def irradiance(corners: np.ndarray, radiosity: np.ndarray, tolerance: float, factor: float | None) -> np.ndarray:
    """(2, p, 3) that clusters give and that all lights give. factor: found for the scene where it is None."""
    lights, probes, points = (
        lights_from_triangles(corners),
        points_of(corners, PROBES, 0),
        points_of(corners, JUDGED, 1),
    )
    tree = build_light_tree(lights)
    mean = mean_irradiance([tree], lights, radiosity, probes)
    if factor is None:
        factor = window_factor([tree], lights, radiosity, tolerance, mean, probes)
        assert factor > 1.0
    clusters = light_clusters(tree, lights, radiosity, tolerance, mean, factor)
    at = points.positions, points.normals, points.tag_ids
    found = cut_irradiance(tree, clusters, lights, radiosity, *at).irradiance
    return np.stack([found, full_irradiance(lights, radiosity, *at)])


@pytest.mark.parametrize(
    ("scene", "tolerance"),
    [
        (even(cuboid(30.0, 2.0, 2.5, 2.0)), 0.02),
        (even(soup(800)), 0.01),
        (pavilion(), 0.05),
        (pavilion(), 0.1),
        (checkered(2.5), 0.02),
    ],
    ids=["corridor", "soup", "pavilion 5 %", "pavilion 10 %", "two colours"],
)
def test_a_tolerance_holds_where_the_model_alone_says_too_little(
    scene: tuple[np.ndarray, np.ndarray], tolerance: float
) -> None:
    assert not within_tolerance(point_error(*irradiance(*scene, tolerance, 1.0)), tolerance)
    assert within_tolerance(point_error(*irradiance(*scene, tolerance, None)), tolerance)


def factor_of(corners: np.ndarray, probes: SurfacePoints) -> float:
    lights, radiosity = lights_from_triangles(corners), np.ones((len(corners), 3))
    tree = build_light_tree(lights)
    return window_factor([tree], lights, radiosity, 0.02, mean_irradiance([tree], lights, radiosity, probes), probes)


def test_windows_of_a_room_stay_as_they_are() -> None:
    corners = cuboid(4.0, 3.0, 3.0, 3.0)
    assert factor_of(corners, points_of(corners, PROBES, 0)) == 1.0


def test_without_probes_or_lights_windows_stay_as_they_are() -> None:
    assert factor_of(soup(50), NO_POINTS) == 1.0
    lights = lights_from_triangles(soup(50))
    assert window_factor([], lights, np.ones((50, 3)), 0.02, 1.0, points_of(soup(50), PROBES, 0)) == 1.0


def test_lights_that_move_count_as_well() -> None:
    corners, radiosity = even(cuboid(30.0, 2.0, 2.5, 2.0))
    lights = replace(lights_from_triangles(corners), dynamic=np.arange(len(corners)) >= 20)
    bounds = (corners.min(axis=(0, 1)), corners.max(axis=(0, 1)))
    settings = GridSettings(tolerance=0.02)
    grid = LightGrid.bake(lights, bounds, settings, probes=points_of(corners, PROBES, 0)).relit(lights, radiosity)
    points = points_of(corners, JUDGED, 1)
    error = grid_error(grid, lights, radiosity, points)
    assert grid.window_factor > 1.0
    assert within_tolerance(error.point_errors, 0.02)
