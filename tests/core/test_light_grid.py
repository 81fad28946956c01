# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid in range mode: lists, queries, limits, report, what it must refuse."""

from __future__ import annotations

import numpy as np
import pytest

from tests.light_meshes import random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.active_hemisphere import HalfBalls, overlaps
from vlm_addon.core.cell_limit import form_factor_bounds
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_grid import OUTSIDE, GridSettings, LightGrid, light_shapes
from vlm_addon.core.light_grid_loss import lost_irradiance
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.settings import from_mapping

BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))


def cell_boxes(grid):
    """(3, cells) lower and upper corners of all cells."""
    n = grid.frame.cells_per_axis
    k, j, i = np.indices((n, n, n)).reshape(3, -1)
    edges, axes, places = grid.frame.edges, np.arange(3)[:, None], np.stack((i, j, k))
    return edges[axes, places], edges[axes, places + 1]


def brute_force(grid):
    """(cells, lights) bool: every cell against every light."""
    low, high = cell_boxes(grid)
    columns = []
    for light in range(grid.light_count):
        same = np.full(low.shape[1], light)
        columns.append(overlaps(grid.half_balls.take(same), low, high))
    return np.stack(columns, axis=1)


def lists_as_table(grid):
    table = np.zeros((len(grid.lists.counts), grid.light_count), bool)
    table[np.repeat(np.arange(len(table)), grid.lists.counts), grid.lists.light_ids] = True
    return table


@pytest.mark.parametrize("seed", range(50))
def test_lists_are_those_of_brute_force(seed):
    rng = np.random.default_rng(seed)
    lights = random_lights(seed)
    low = lights.vertices.min(axis=0) + rng.uniform(-0.5, 0.5, 3)
    bounds = (low, low + rng.uniform(0.1, 4.0, 3))
    for cells in rng.permutation(np.arange(1, 13))[:4]:
        grid = LightGrid.bake(lights, bounds, GridSettings(int(cells), float(rng.uniform(0.5, 8.0))))
        expected = brute_force(grid)
        assert np.array_equal(lists_as_table(grid), expected)
        assert np.array_equal(grid.lists.counts, expected.sum(axis=1))


def test_every_grid_size_and_range_on_one_light_mesh():
    lights = random_lights(7, 20)
    for cells in range(1, 13):
        for reach in (0.5, 1.0, 2.0, 4.0, 8.0):
            grid = LightGrid.bake(lights, BOX, GridSettings(cells, reach))
            assert np.array_equal(lists_as_table(grid), brute_force(grid))


def test_lists_ascend_and_are_the_same_every_time():
    grid, again = (LightGrid.bake(random_lights(3, 300), BOX, GridSettings(9, 3.0)) for _ in range(2))
    for start, end in zip(grid.lists.offsets[:-1], grid.lists.offsets[1:], strict=True):
        assert (np.diff(grid.lists.light_ids[start:end].astype(np.int64)) > 0).all()
    assert grid.lists.light_ids.tobytes() == again.lists.light_ids.tobytes()
    assert grid.lists.offsets.tobytes() == again.lists.offsets.tobytes()


def test_a_candidate_is_any_light_whose_hemisphere_holds_the_point():
    lights, reach = random_lights(11, 100), 3.0
    grid = LightGrid.bake(lights, BOX, GridSettings(8, reach))
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3))
    offsets, ids = grid.candidates(points)
    corners = lights.corners
    centroids = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centroids[:, None], axis=2).max(axis=1)
    arms = points[:, None] - centroids
    heights = (arms * lights.area_vectors).sum(axis=2) / np.maximum(lights.areas, 1e-300)
    holds = (np.linalg.norm(arms, axis=2) < reach * radii - 1e-5) & (heights > 1e-5) & (lights.areas > 0.0)
    found = np.zeros_like(holds)
    found[np.repeat(np.arange(len(points)), np.diff(offsets.astype(int))), ids] = True
    assert holds.any()
    assert not (holds & ~found).any()


def test_a_point_outside_gets_the_lights_that_hold_it_and_no_cell():
    lights = random_lights(5, 60)
    grid = LightGrid.bake(lights, ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5)), GridSettings(4, 4.0))
    points = np.array([[0.2, 0.2, 0.2], [-0.5, 0.1, 0.2], [0.3, 0.3, 0.3], [0.1, 0.9, 0.4]])
    assert (grid.frame.cells(points) == OUTSIDE).tolist() == [False, True, False, True]
    offsets, ids = grid.candidates(points)
    wider = LightGrid.bake(lights, ((-1.0, -1.0, -1.0), (1.5, 1.5, 1.5)), GridSettings(1, 4.0))
    shapes = light_shapes(lights, wider.frame, 4.0)
    for row in (1, 3):
        place = wider.frame.local(points[row]).astype(np.float32)[:, None]
        expected = np.flatnonzero(overlaps(shapes.half_balls, place, place))
        assert len(expected)
        assert ids[offsets[row] : offsets[row + 1]].tolist() == expected.tolist()
    for row in (0, 2):
        alone_offsets, alone = grid.candidates(points[row : row + 1])
        assert ids[offsets[row] : offsets[row + 1]].tolist() == alone[: alone_offsets[1]].tolist()


def test_points_on_the_bounds_are_inside():
    frame = LightGrid.bake(random_lights(0, 5), BOX, GridSettings(7)).frame
    corners = np.array(np.meshgrid(*np.transpose(BOX))).reshape(3, -1).T
    cells = frame.cells(corners)
    assert sorted(cells) == sorted((k * 7 + j) * 7 + i for i in (0, 6) for j in (0, 6) for k in (0, 6))


def test_lights_without_area_and_lights_not_chosen_are_in_no_cell():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 3, float)
    corners[1, 2] = corners[1, 1]
    grid = LightGrid.bake(lights_from_triangles(corners), BOX, GridSettings(3, 2.0), chosen=np.array([1, 1, 0], bool))
    assert set(grid.lists.light_ids) == {0}


def test_static_and_dynamic_grids_hold_all_lights_between_them():
    lights = random_lights(2, 80)
    moving = np.arange(80) % 3 == 0
    settings = GridSettings(6, 3.0)
    whole, static, dynamic = (
        lists_as_table(LightGrid.bake(lights, BOX, settings, chosen=chosen)) for chosen in (None, ~moving, moving)
    )
    assert np.array_equal(whole, static | dynamic)
    assert not (static & dynamic).any()


def test_moved_and_scaled_by_powers_of_two_gives_the_same_lists():
    lights = random_lights(4, 50)
    corners, settings = np.round(lights.corners * 256.0) / 256.0, GridSettings(10, 3.0)
    near = LightGrid.bake(lights_from_triangles(corners), BOX, settings)
    for scale, shift in ((1024.0, 8192.0), (2.0**-12, -16.0)):
        moved = LightGrid.bake(lights_from_triangles(corners * scale + shift), np.array(BOX) * scale + shift, settings)
        assert np.array_equal(moved.lists.light_ids, near.lists.light_ids)


def test_a_flat_scene_and_a_point_have_cells():
    for bounds in (((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)), ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0))):
        grid = LightGrid.bake(random_lights(1), bounds, GridSettings(5, 2.0))
        assert (np.diff(grid.frame.edges, axis=1) > 0.0).all()
        assert (grid.frame.cells(np.array(bounds)) != OUTSIDE).all()
        assert np.array_equal(lists_as_table(grid), brute_force(grid))


def test_no_lights_and_no_points():
    grid = LightGrid.bake(empty_light_mesh(), BOX, GridSettings(3))
    assert grid.lists.counts.tolist() == [0] * 27
    offsets, ids = grid.candidates(np.zeros((0, 3)))
    assert offsets.tolist() == [0]
    assert len(ids) == 0


def test_a_full_cell_keeps_the_lights_that_may_give_it_most():
    lights, limit = random_lights(6, 120), 7
    free = LightGrid.bake(lights, BOX, GridSettings(5, 5.0))
    full = LightGrid.bake(lights, BOX, GridSettings(5, 5.0, limit))
    shapes = light_shapes(lights, free.frame, 5.0)
    before, after = lists_as_table(free), lists_as_table(full)
    assert not (after & ~before).any()
    assert np.array_equal(after.sum(axis=1), np.minimum(before.sum(axis=1), limit))
    for cell in np.flatnonzero(before.sum(axis=1) > limit):
        same = np.full(120, cell)
        bounds = form_factor_bounds(shapes.half_balls, shapes.areas, shapes.radii, free.frame.edges, same).astype(
            np.float32
        )
        dropped = before[cell] & ~after[cell]
        assert bounds[dropped].max() <= bounds[after[cell]].min()
    occupancy = full.occupancy
    lost = (before & ~after).sum(axis=0)
    assert occupancy.fullest == before.sum(axis=1).max() > limit
    assert occupancy.overflowing_cells.tolist() == np.flatnonzero(before.sum(axis=1) > limit).tolist()
    assert occupancy.dropped_entries == lost.sum()
    assert occupancy.cells_dropped_from.tolist() == lost.tolist()
    assert occupancy.dropped_lights.tolist() == np.flatnonzero(lost).tolist()
    assert "overflow" in occupancy.summary()
    assert "nothing dropped" in free.occupancy.summary()


def test_of_equal_lights_a_full_cell_keeps_the_first():
    corners = np.tile(np.eye(3), (9, 1, 1))
    grid = LightGrid.bake(lights_from_triangles(corners), BOX, GridSettings(2, 50.0, 4))
    assert set(grid.lists.light_ids) == {0, 1, 2, 3}
    assert grid.occupancy.dropped_lights.tolist() == [4, 5, 6, 7, 8]


def test_no_point_of_a_cell_gets_more_than_the_bound():
    lights = random_lights(8, 60)
    grid = LightGrid.bake(lights, BOX, GridSettings(6, 4.0))
    shapes = light_shapes(lights, grid.frame, 4.0)
    rng = np.random.default_rng(1)
    points = rng.uniform(*BOX, (300, 3))
    corners, area_vectors = lights.corners, lights.area_vectors
    cells = grid.frame.cells(points)
    factors = np.zeros((300, 60))
    # Towards each light, where it gives the most.
    for light in np.flatnonzero(lights.areas > 0.0):
        towards = corners[light].mean(axis=0) - points
        factors[:, light] = np.diag(polygon_form_factor(points, towards, corners[light : light + 1])[:, [0] * 300])
    for light in range(60):
        same = shapes.half_balls.take(np.full(300, light))
        bounds = form_factor_bounds(
            same, np.full(300, shapes.areas[light]), np.full(300, shapes.radii[light]), grid.frame.edges, cells
        )
        in_front = ((points - corners[light, 0]) * area_vectors[light]).sum(axis=1) > 0.0
        assert (factors[in_front, light] <= bounds[in_front] * (1.0 + 1e-4) + 1e-12).all()


def test_fixed_size_lists_hold_the_same_and_a_light_that_emits_nothing():
    lights = random_lights(9, 70)
    for limit in (0, 6):
        grid = LightGrid.bake(lights, BOX, GridSettings(4, 3.0, limit))
        fixed = grid.fixed_size_lists()
        assert fixed.shape == (64, limit or grid.occupancy.fullest)
        assert fixed.dtype == np.uint32
        for cell, row in enumerate(fixed):
            start, end = grid.lists.offsets[cell : cell + 2]
            assert row[: end - start].tolist() == grid.lists.light_ids[start:end].tolist()
            assert (row[end - start :] == grid.light_count).all()


def test_nbytes_counts_every_array():
    grid = LightGrid.bake(random_lights(9, 70), BOX, GridSettings(4, 3.0))
    entries = len(grid.lists.light_ids)
    assert grid.nbytes == 4 * entries + 4 * 65 + 3 * 5 * 4 + 70 * 10 * 4


def test_what_is_lost_is_the_irradiance_of_lights_that_are_no_candidates():
    lights = random_lights(12, 60)
    rng = np.random.default_rng(2)
    points, normals = rng.uniform(*BOX, (40, 3)), rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    radiosity = rng.uniform(0.0, 3.0, (60, 3))
    factors = polygon_form_factor(points, normals, lights.corners)
    grid = LightGrid.bake(lights, BOX, GridSettings(5, 2.5, 3))
    lost = lost_irradiance(grid, lights, radiosity, points, normals)
    cells = grid.frame.cells(points)
    np.testing.assert_allclose(lost.full, factors @ radiosity, rtol=1e-12)
    np.testing.assert_allclose(lost.kept, (factors * lists_as_table(grid)[cells]) @ radiosity, rtol=1e-12)
    np.testing.assert_allclose(lost.in_range, (factors * brute_force(grid)[cells]) @ radiosity, rtol=1e-12)
    assert lost.share_out_of_range > 0.0
    assert lost.share_overflowed > 0.0
    assert lost.share == pytest.approx(lost.share_out_of_range + lost.share_overflowed)
    assert ((lost.point_shares >= 0.0) & (lost.point_shares <= 1.0)).all()


def test_nothing_is_lost_where_every_light_reaches_everything():
    lights = random_lights(13, 30)
    lights = lights_from_triangles(lights.corners[lights.areas > 1e-4])
    points = np.random.default_rng(3).uniform(*BOX, (20, 3))
    normals = np.tile([0.0, 0.0, 1.0], (20, 1))
    grid = LightGrid.bake(lights, BOX, GridSettings(3, 1e4))
    lost = lost_irradiance(grid, lights, np.ones((len(lights), 3)), points, normals)
    assert lost.share == pytest.approx(0.0, abs=1e-12)


def test_settings_take_texts_and_refuse_what_is_out_of_range():
    assert from_mapping(GridSettings, {"grid": "20", "range": "3.5", "max_lights": 40}, "bake") == GridSettings(
        20, 3.5, 40
    )
    for bad in ({"grid": 0}, {"grid": 257}, {"range": -1.0}, {"range": "nan"}, {"max_lights": -1}):
        with pytest.raises(InvalidInput):
            from_mapping(GridSettings, bad, "bake")


def test_refuses_what_it_cannot_use():
    lights = random_lights(0, 5)
    for bounds in (((0, 0, 0), (1, np.nan, 1)), ((0, 0, 1), (1, 1, 0)), ((0, 0), (1, 1))):
        with pytest.raises(InvalidInput, match="bounds"):
            LightGrid.bake(lights, bounds)
    with pytest.raises(InvalidInput, match="give bounds that hold the scene"):
        LightGrid.bake(lights_from_triangles(lights.corners + 1e12), BOX)
    grid = LightGrid.bake(lights, BOX, GridSettings(3))
    for points in ([[0.0, np.nan, 0.0]], [0.0, 0.0, 0.0]):
        with pytest.raises(InvalidInput, match="points"):
            grid.candidates(points)
    with pytest.raises(InvalidInput, match="bake it again"):
        grid.require_made_of(random_lights(1, 5))
    with pytest.raises(InvalidInput, match="radiosity"):
        lost_irradiance(grid, lights, np.ones((4, 3)), np.zeros((1, 3)), np.ones((1, 3)))


def test_baking_can_be_cancelled():
    seen = []

    def stop(fraction, label):
        seen.append(fraction)
        return fraction < 0.5

    with pytest.raises(Cancelled):
        LightGrid.bake(random_lights(0, 5), BOX, GridSettings(10), stop)
    assert seen == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])


def test_half_balls_of_other_lights_are_taken_by_row():
    grid = LightGrid.bake(random_lights(0, 5), BOX, GridSettings(2))
    taken = grid.half_balls.take(np.array([3, 3]))
    assert isinstance(taken, HalfBalls)
    assert np.array_equal(taken.centres[:, 0], grid.half_balls.centres[:, 3])
