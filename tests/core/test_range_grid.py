# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid in range mode: lists, queries, limits, what it must refuse."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.light_meshes import random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.active_hemisphere import HalfBalls, make_half_balls, overlaps
from vlm_addon.core.array_codec import content_hash
from vlm_addon.core.cell_limit import BlockDiscs
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.grid_frame import OUTSIDE
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.range_grid import RangeGrid, RangeSettings, light_shapes
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


def ranks_of(shapes, frame, place):
    """(64, lights) by which full cells of a block choose."""
    discs = BlockDiscs(shapes.half_balls, shapes.areas, frame.edges, place)
    return discs.form_factors(np.arange(len(shapes.areas)))


def lists_as_table(grid):
    """(cells, lights) bool, from the lists of all cells."""
    table = np.zeros((grid.settings.grid**3, grid.light_count), bool)
    offsets, ids = grid.lists.cell_lists(np.arange(len(table)))
    table[np.repeat(np.arange(len(table)), np.diff(offsets)), ids] = True
    assert table.sum() == len(ids)
    return table


@pytest.mark.parametrize("seed", range(50))
def test_lists_are_those_of_brute_force(seed):
    rng = np.random.default_rng(seed)
    lights = random_lights(seed)
    low = lights.vertices.min(axis=0) + rng.uniform(-0.5, 0.5, 3)
    bounds = (low, low + rng.uniform(0.1, 4.0, 3))
    for cells in rng.permutation(np.arange(1, 13))[:4]:
        grid = RangeGrid.bake(lights, bounds, RangeSettings(int(cells), float(rng.uniform(0.5, 8.0))))
        expected = brute_force(grid)
        assert np.array_equal(lists_as_table(grid), expected)
        assert np.array_equal(grid.lists.cell_counts(), expected.sum(axis=1))


def test_every_grid_size_and_range_on_one_light_mesh():
    lights = random_lights(7, 20)
    for cells in range(1, 13):
        for reach in (0.5, 1.0, 2.0, 4.0, 8.0):
            grid = RangeGrid.bake(lights, BOX, RangeSettings(cells, reach))
            assert np.array_equal(lists_as_table(grid), brute_force(grid))


@pytest.mark.parametrize("cells", [30, 65, 103])
def test_large_grids_and_their_last_blocks(cells):
    """Random cells and those at the upper faces, where blocks hold less than 64."""
    lights = random_lights(17, 60)
    grid = RangeGrid.bake(lights, BOX, RangeSettings(cells, 3.0))
    places = np.random.default_rng(cells).integers(0, cells, (300, 3))
    places[::2, cells % 3] = cells - 1
    chosen = places @ [1, cells, cells**2]
    offsets, ids = grid.lists.cell_lists(chosen)
    assert len(ids)
    for row, cell in enumerate(chosen):
        assert ids[offsets[row] : offsets[row + 1]].tolist() == np.flatnonzero(grid.reaching(int(cell))).tolist()


def test_lists_ascend_and_are_the_same_every_time():
    grid, again = (RangeGrid.bake(random_lights(3, 300), BOX, RangeSettings(9, 3.0)) for _ in range(2))
    offsets, ids = grid.lists.cell_lists(np.arange(9**3))
    for start, end in itertools.pairwise(offsets):
        assert (np.diff(ids[start:end].astype(np.int64)) > 0).all()
    assert content_hash(grid) == content_hash(again)


def test_a_candidate_is_any_light_whose_hemisphere_holds_the_point():
    lights, reach = random_lights(11, 100), 3.0
    grid = RangeGrid.bake(lights, BOX, RangeSettings(8, reach))
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
    grid = RangeGrid.bake(lights, ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5)), RangeSettings(4, 4.0))
    points = np.array([[0.2, 0.2, 0.2], [-0.5, 0.1, 0.2], [0.3, 0.3, 0.3], [0.1, 0.9, 0.4]])
    assert (grid.frame.cells(points) == OUTSIDE).tolist() == [False, True, False, True]
    offsets, ids = grid.candidates(points)
    wider = RangeGrid.bake(lights, ((-1.0, -1.0, -1.0), (1.5, 1.5, 1.5)), RangeSettings(1, 4.0))
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
    frame = RangeGrid.bake(random_lights(0, 5), BOX, RangeSettings(7)).frame
    corners = np.array(np.meshgrid(*np.transpose(BOX))).reshape(3, -1).T
    cells = frame.cells(corners)
    assert sorted(cells) == sorted((k * 7 + j) * 7 + i for i in (0, 6) for j in (0, 6) for k in (0, 6))


def test_lights_without_area_and_lights_not_chosen_are_in_no_cell():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 3, float)
    corners[1, 2] = corners[1, 1]
    grid = RangeGrid.bake(lights_from_triangles(corners), BOX, RangeSettings(3, 2.0), chosen=np.array([1, 1, 0], bool))
    assert set(grid.lists.light_ids) == {0}


def test_static_and_dynamic_grids_hold_all_lights_between_them():
    lights = random_lights(2, 80)
    moving = np.arange(80) % 3 == 0
    settings = RangeSettings(6, 3.0)
    whole, static, dynamic = (
        lists_as_table(RangeGrid.bake(lights, BOX, settings, chosen=chosen)) for chosen in (None, ~moving, moving)
    )
    assert np.array_equal(whole, static | dynamic)
    assert not (static & dynamic).any()


def test_moved_and_scaled_by_powers_of_two_gives_the_same_lists():
    lights = random_lights(4, 50)
    corners, settings = np.round(lights.corners * 256.0) / 256.0, RangeSettings(10, 3.0)
    near = RangeGrid.bake(lights_from_triangles(corners), BOX, settings)
    for scale, shift in ((1024.0, 8192.0), (2.0**-12, -16.0)):
        moved = RangeGrid.bake(lights_from_triangles(corners * scale + shift), np.array(BOX) * scale + shift, settings)
        assert content_hash(moved.lists) == content_hash(near.lists)


def test_a_flat_scene_and_a_point_have_cells():
    for bounds in (((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)), ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0))):
        grid = RangeGrid.bake(random_lights(1), bounds, RangeSettings(5, 2.0))
        assert (np.diff(grid.frame.edges, axis=1) > 0.0).all()
        assert (grid.frame.cells(np.array(bounds)) != OUTSIDE).all()
        assert np.array_equal(lists_as_table(grid), brute_force(grid))


def test_no_lights_and_no_points():
    grid = RangeGrid.bake(empty_light_mesh(), BOX, RangeSettings(3))
    assert grid.lists.cell_counts().tolist() == [0] * 27
    offsets, ids = grid.candidates(np.zeros((0, 3)))
    assert offsets.tolist() == [0]
    assert len(ids) == 0


def test_a_full_cell_keeps_the_lights_that_may_give_it_most():
    lights, limit = random_lights(6, 120), 7
    free = RangeGrid.bake(lights, BOX, RangeSettings(5, 5.0))
    full = RangeGrid.bake(lights, BOX, RangeSettings(5, 5.0, limit))
    before, after = lists_as_table(free), lists_as_table(full)
    assert not (after & ~before).any()
    assert np.array_equal(after.sum(axis=1), np.minimum(before.sum(axis=1), limit))
    shapes = light_shapes(lights, free.frame, 5.0)
    for block in range(free.lists.blocks_per_axis**3):
        place = free.lists.block_place(block)
        worth = ranks_of(shapes, free.frame, place)
        for cell, bit in zip(*free.lists.cells_of(block), strict=True):
            if before[cell].sum() > limit:
                order = sorted(np.flatnonzero(before[cell]), key=lambda light: (-worth[bit, light], light))
                assert sorted(order[:limit]) == np.flatnonzero(after[cell]).tolist()
    occupancy = full.occupancy
    lost = (before & ~after).sum(axis=0)
    assert occupancy.fullest == before.sum(axis=1).max() > limit
    assert occupancy.overflowing_cells.tolist() == np.flatnonzero(before.sum(axis=1) > limit).tolist()
    assert occupancy.dropped_entries == lost.sum()
    assert occupancy.cells_dropped_from.tolist() == lost.tolist()
    assert occupancy.dropped_lights.tolist() == np.flatnonzero(lost).tolist()
    assert len(free.occupancy.overflowing_cells) == free.occupancy.dropped_entries == 0


def test_of_equal_lights_a_full_cell_keeps_the_first():
    corners = np.tile(np.eye(3), (9, 1, 1))
    grid = RangeGrid.bake(lights_from_triangles(corners), BOX, RangeSettings(2, 50.0, 4))
    assert set(grid.lists.light_ids) == {0, 1, 2, 3}
    assert grid.occupancy.dropped_lights.tolist() == [4, 5, 6, 7, 8]


def test_a_small_light_gives_no_point_of_a_cell_more_than_its_rank():
    """Of a light that is small beside its distance, the rank is its greatest form factor within the cell."""
    rng = np.random.default_rng(1)
    corners = rng.uniform(-4.0, 4.0, (60, 1, 3)) + 1e-3 * rng.normal(size=(60, 3, 3))
    lights = lights_from_triangles(corners)
    grid = RangeGrid.bake(lights, BOX, RangeSettings(6, 1e4))
    shapes = light_shapes(lights, grid.frame, 1e4)
    points = rng.uniform(*BOX, (400, 3))
    blocks, bits = grid.lists.places(grid.frame.cells(points))
    shown = 0
    for light, centroid in enumerate(corners.mean(axis=1)):
        towards = centroid - points
        facing = np.array(
            [
                polygon_form_factor(point[None], normal[None], corners[light : light + 1])[0, 0]
                for point, normal in zip(points[light::60], towards[light::60], strict=True)
            ]
        )
        ranks = np.array(
            [
                ranks_of(shapes, grid.frame, grid.lists.block_place(block))[bit, light]
                for block, bit in zip(blocks[light::60], bits[light::60].astype(int), strict=True)
            ]
        )
        far = np.linalg.norm(towards[light::60], axis=1) > 0.05
        assert (facing[far] <= ranks[far] * 1.01 + 1e-12).all()
        shown += (facing > 0.0).sum()
    assert shown > 100


def test_a_rank_is_exact_over_the_middle_of_a_disc():
    """At a cell without extent, over the centroid: A / (pi d² + A)."""
    half_balls = make_half_balls(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([1.0]))
    edges = np.array([[0.0, 0.0], [0.0, 0.0], [0.25, 0.25]], np.float32)
    worth = BlockDiscs(half_balls, np.array([0.1]), edges, np.zeros(3, int)).form_factors(np.array([0]))
    assert worth[0, 0] == pytest.approx(0.1 / (np.pi * 0.25**2 + 0.1), rel=1e-6)


def test_fixed_size_lists_hold_the_same_and_a_light_that_emits_nothing():
    lights = random_lights(9, 70)
    for limit in (0, 6):
        grid = RangeGrid.bake(lights, BOX, RangeSettings(4, 3.0, limit))
        fixed = grid.fixed_size_lists()
        assert fixed.shape == (64, limit or grid.occupancy.fullest)
        assert fixed.dtype == np.uint32
        for listed, row in zip(lists_as_table(grid), fixed, strict=True):
            count = listed.sum()
            assert row[:count].tolist() == np.flatnonzero(listed).tolist()
            assert (row[count:] == grid.light_count).all()


def test_fixed_size_lists_that_no_memory_holds_are_refused():
    grid = RangeGrid.bake(random_lights(9, 10), BOX, RangeSettings(20, 3.0, 1_000_000))
    with pytest.raises(InvalidInput, match=r"8,000 of 1,000,000 lights take 32\.0 GB; set max_lights"):
        grid.fixed_size_lists()


def test_nbytes_counts_every_array():
    grid = RangeGrid.bake(random_lights(9, 70), BOX, RangeSettings(4, 3.0))
    pairs = len(grid.lists.light_ids)
    assert pairs
    assert grid.nbytes == (4 + 8) * pairs + 4 * 2 + 3 * 5 * 4 + 70 * 10 * 4


def test_settings_take_texts_and_refuse_what_is_out_of_range():
    assert from_mapping(RangeSettings, {"grid": "20", "range": "3.5", "max_lights": 40}, "bake") == RangeSettings(
        20, 3.5, 40
    )
    for bad in ({"grid": 0}, {"grid": 257}, {"range": -1.0}, {"range": "nan"}, {"max_lights": -1}):
        with pytest.raises(InvalidInput):
            from_mapping(RangeSettings, bad, "bake")


def test_refuses_what_it_cannot_use():
    lights = random_lights(0, 5)
    for bounds in (((0, 0, 0), (1, np.nan, 1)), ((0, 0, 1), (1, 1, 0)), ((0, 0), (1, 1))):
        with pytest.raises(InvalidInput, match="bounds"):
            RangeGrid.bake(lights, bounds)
    with pytest.raises(InvalidInput, match="give bounds that hold the scene"):
        RangeGrid.bake(lights_from_triangles(lights.corners + 1e12), BOX)
    grid = RangeGrid.bake(lights, BOX, RangeSettings(3))
    for points in ([[0.0, np.nan, 0.0]], [0.0, 0.0, 0.0]):
        with pytest.raises(InvalidInput, match="points"):
            grid.candidates(points)


def test_baking_can_be_cancelled():
    seen = []

    def stop(fraction, label):
        seen.append((label, fraction))
        return len(seen) < 4

    with pytest.raises(Cancelled):
        RangeGrid.bake(random_lights(0, 5), BOX, RangeSettings(20), stop)
    assert seen == [("light grid", pytest.approx(0.2 * k)) for k in range(1, 5)]
    seen.clear()
    with pytest.raises(Cancelled):
        RangeGrid.bake(random_lights(6, 120), BOX, RangeSettings(10, 5.0, 7), stop)
    assert seen == [("light grid", pytest.approx(k / 3)) for k in (1, 2, 3)] + [("full cells", 1.0)]


def test_half_balls_of_other_lights_are_taken_by_row():
    grid = RangeGrid.bake(random_lights(0, 5), BOX, RangeSettings(2))
    taken = grid.half_balls.take(np.array([3, 3]))
    assert isinstance(taken, HalfBalls)
    assert np.array_equal(taken.centres[:, 0], grid.half_balls.centres[:, 3])
