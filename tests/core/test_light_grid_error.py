# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light grid loses, against sums over all lights that the test makes itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.light_meshes import random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_grid import RANGE, GridSettings, LightGrid
from vlm_addon.core.light_grid_error import GridError, grid_error
from vlm_addon.core.surface_points import SurfacePoints

BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))


def case(seed, count=60, points=40):
    """Lights of which some have tags and some move, points of which some have tags, radiosity, form factors."""
    rng = np.random.default_rng(seed)
    lights = replace(
        random_lights(seed, count),
        tag_ids=rng.integers(0, 3, count).astype(np.int32),
        dynamic=np.arange(count) % 3 == 0,
    )
    normals = rng.normal(size=(points, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    surface = SurfacePoints(rng.uniform(*BOX, (points, 3)), normals, rng.integers(0, 3, points).astype(np.int32))
    radiosity = rng.uniform(0.0, 3.0, (count, 3))
    factors = polygon_form_factor(surface.positions, normals, lights.corners)
    factors[(surface.tag_ids[:, None] == lights.tag_ids) & (lights.tag_ids > 0)] = 0.0
    return lights, surface, radiosity, factors


def candidate_table(grid, surface, count):
    found = grid.candidates(surface.positions)
    table = np.zeros((len(surface.positions), count), bool)
    table[np.repeat(np.arange(len(table)), np.diff(found.light_offsets)), found.light_ids] = True
    return table


def test_what_is_lost_is_the_irradiance_of_lights_that_are_no_candidates():
    lights, surface, radiosity, factors = case(12)
    settings = GridSettings(mode=RANGE, grid=5, range=2.5, max_lights=3)
    grid = LightGrid.bake(lights, BOX, settings)
    free = LightGrid.bake(lights, BOX, replace(settings, max_lights=0))
    error = grid_error(grid, lights, radiosity, surface)
    np.testing.assert_allclose(error.full, factors @ radiosity, rtol=1e-12)
    np.testing.assert_allclose(error.found, (factors * candidate_table(grid, surface, 60)) @ radiosity, rtol=1e-12)
    np.testing.assert_allclose(error.in_range, (factors * candidate_table(free, surface, 60)) @ radiosity, rtol=1e-12)
    assert error.share_out_of_range > 0.0
    assert error.share_overflowed > 0.0
    assert error.share_lost == pytest.approx(error.share_out_of_range + error.share_overflowed)


def test_within_a_tolerance_little_is_lost():
    lights, surface, radiosity, factors = case(14, 400)
    errors = {}
    for tolerance in (0.01, 0.5):
        grid = LightGrid.bake(lights, BOX, GridSettings(tolerance=tolerance))
        error = grid_error(grid, lights, radiosity, surface)
        np.testing.assert_allclose(error.full, factors @ radiosity, rtol=1e-12)
        errors[tolerance] = error.percentiles()
        assert error.share_overflowed == 0.0
        assert abs(error.share_lost) < tolerance
    assert errors[0.01]["95 %"] < 0.01
    assert errors[0.5]["95 %"] > errors[0.01]["95 %"]


def test_nothing_is_lost_where_every_light_reaches_everything():
    lights = random_lights(13, 30)
    lights = lights_from_triangles(lights.corners[lights.areas > 1e-4])
    normals = np.tile([0.0, 0.0, 1.0], (20, 1))
    points = SurfacePoints(np.random.default_rng(3).uniform(*BOX, (20, 3)), normals, np.zeros(20, np.int32))
    grid = LightGrid.bake(lights, BOX, GridSettings(mode=RANGE, grid=3, range=1e4))
    error = grid_error(grid, lights, np.ones((len(lights), 3)), points)
    assert error.full.any()
    assert error.percentiles()["99.9 %"] < 1e-12


def test_point_errors_are_shares_of_the_point_or_of_a_tenth_of_the_mean():
    full = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    found = np.array([[1.5, 0.0, 0.0], [0.1, 0.0, 0.0], [1.0, 1.0, 1.0]])
    error = GridError(full, found, full)
    assert error.point_errors.tolist() == pytest.approx([0.5, 0.5, 0.0])
    assert error.percentiles() == pytest.approx({"median": 0.5, "95 %": 0.5, "99.9 %": 0.5})
    assert error.share_lost == pytest.approx(1.4 / 6.0)


def test_no_points_have_no_error():
    none = np.zeros((0, 3))
    error = GridError(none, none, none)
    assert error.percentiles() == {"median": 0.0, "95 %": 0.0, "99.9 %": 0.0}
    assert error.share_lost == 0.0


def test_refuses_other_lights_and_radiosity_of_another_shape():
    lights, surface, radiosity, _ = case(0)
    grid = LightGrid.bake(lights, BOX, GridSettings(mode=RANGE))
    with pytest.raises(InvalidInput, match="bake it again"):
        grid_error(grid, case(1)[0], radiosity, surface)
    with pytest.raises(InvalidInput, match="radiosity"):
        grid_error(grid, lights, radiosity[1:], surface)
