# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and lines that overlays draw, and what they say of a light grid's cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import lights_from_triangles
from vlm_addon.core.display_colors import hdr_colors, heat_colors, srgb, tag_colors
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.grid_samples import BOXES_PER_AXIS, cells_around, grid_view, look, slice_cells
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_grid import RANGE, TOLERANCE, GridSettings, LightGrid
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.overlay_lines import NORMAL_LENGTH, box_lines, half_ball_lines, normal_lines, outlines
from vlm_addon.core.surface_points import SurfacePoints

BOUNDS = (np.zeros(3), np.ones(3))
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
BESIDE = np.array([1.0, 0, 0])


def ball_of_lights(count: int = 500) -> VirtualLightMesh:
    generator = np.random.default_rng(2)
    corners = generator.uniform(0.1, 0.9, (count, 1, 3)) + generator.normal(0.0, 0.03, (count, 3, 3))
    return lights_from_triangles(corners, colour=0.5)


def as_set(lines: np.ndarray) -> set[tuple]:
    """Lines without direction."""
    return {tuple(sorted(map(tuple, np.round(line, 9).tolist()))) for line in lines}


def test_srgb_is_the_standards_curve() -> None:
    assert srgb([0.0, 0.0031308, 0.18, 0.5, 1.0, 7.0]) == pytest.approx([0, 0.0404, 0.4614, 0.7354, 1, 1], abs=1e-4)


def test_brighter_lights_look_brighter_however_bright_they_are_and_keep_their_hue() -> None:
    sizes = np.array([0.01, 0.1, 0.5, 0.8, 1.0, 2.0, 7.5, 100.0, 1e4])
    shown = hdr_colors(sizes[:, None] * np.array([1.0, 0.5, 0.0]))
    assert (np.diff(shown[:, 0]) > 0.0).all()
    assert (shown <= 1.0).all()
    assert (shown[:, 2] == 0.0).all()
    linear = np.where(shown > 0.04045, ((shown + 0.055) / 1.055) ** 2.4, shown / 12.92)
    assert linear[:, 1] / linear[:, 0] == pytest.approx(0.5)
    assert shown[:4] == pytest.approx(srgb(sizes[:4, None] * np.array([1.0, 0.5, 0.0])))


def test_tags_near_each_other_have_colours_that_differ_and_never_change() -> None:
    ids = np.arange(1, 60, dtype=np.int32)
    colors = tag_colors(ids)
    assert (colors >= 0.0).all()
    assert (colors <= 1.0).all()
    apart = np.linalg.norm(colors[:, None] - colors[None], axis=2)
    near = np.abs(ids[:, None] - ids) <= 3
    assert apart[near & ~np.eye(len(ids), dtype=bool)].min() > 0.3
    assert (tag_colors(ids[::-1]) == colors[::-1]).all()
    assert np.isfinite(tag_colors(np.array([-5, 2**31 - 1, -(2**31)], np.int32))).all()


def test_heat_goes_from_blue_over_green_to_red() -> None:
    colors = heat_colors([0.0, 0.5, 1.0, 9.0])
    assert colors.argmax(axis=1).tolist() == [2, 1, 0, 0]
    assert (colors[2] == colors[3]).all()


def test_outlines_have_no_diagonals_and_each_edge_once() -> None:
    corners = np.concatenate([SQUARE[[0, 1, 2]][None], SQUARE[[0, 2, 3]][None], (SQUARE + BESIDE)[[0, 1, 2]][None]])
    found = outlines(corners, np.array([0, 0, 1], np.int32))
    rim = [(0, 1), (1, 2), (2, 3), (3, 0)]
    expected = [SQUARE[[a, b]] for a, b in rim] + [SQUARE[[a, b]] + BESIDE for a, b in ((0, 1), (1, 2), (2, 0))]
    assert as_set(found) == as_set(np.array(expected))
    assert len(found) == len(expected)
    assert outlines(np.zeros((0, 3, 3)), np.zeros(0, np.int32)).shape == (0, 2, 3)


def test_neighbours_share_their_edge() -> None:
    corners = np.array([SQUARE[[0, 1, 2]], SQUARE[[0, 2, 3]]])
    assert len(outlines(corners, np.array([0, 1], np.int32))) == 5


def test_a_line_leads_to_the_shining_side() -> None:
    lines = normal_lines(np.array([[1.0, 2, 3]]), np.array([[0.0, 0, -1]]), np.array([4.0]))
    assert lines[0] == pytest.approx(np.array([[1, 2, 3], [1, 2, 3 - 2 * NORMAL_LENGTH]]))


def test_half_balls_have_their_radius_and_lie_before_the_light() -> None:
    generator = np.random.default_rng(3)
    normals = generator.normal(size=(5, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centres, radii = generator.normal(size=(5, 3)), generator.uniform(0.1, 3.0, 5)
    lines = half_ball_lines(centres, normals, radii).reshape(-1, 3)
    for light in range(5):
        own = np.abs(np.linalg.norm(lines - centres[light], axis=1) - radii[light]) < 1e-9
        heights = (lines[own] - centres[light]) @ normals[light]
        assert heights.min() > -1e-9
        assert heights.max() == pytest.approx(radii[light], rel=1e-2)


def test_a_box_has_twelve_edges() -> None:
    lines = box_lines(np.array([[[0.0, 0, 0], [1, 2, 3]]]))
    corners = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
    expected = [
        [a, b] for a in corners for b in corners if a < b and sum(p != q for p, q in zip(a, b, strict=True)) == 1
    ]
    assert as_set(lines) == as_set(np.array(expected, float))


def test_cells_of_a_range_count_the_lights_of_their_lists() -> None:
    lights = ball_of_lights()
    view = grid_view(LightGrid.bake(lights, BOUNDS, GridSettings(mode=RANGE, grid=9, range=2.0)), lights, BOUNDS)
    assert view.frame.cells_per_axis == 9
    cells = look(view, slice_cells(view.frame, 2, 0.5))
    assert cells.errors is None
    assert len(cells.counts) == 81
    assert np.unique(cells.corners[:, :, 2], axis=0) == pytest.approx(np.array([[4 / 9, 5 / 9]]), abs=1e-6)
    centres = lights.corners.mean(axis=1)
    radii = 2.0 * np.linalg.norm(lights.corners - centres[:, None], axis=2).max(axis=1)
    inside = np.random.default_rng(4).uniform(0.0, 1.0, (2000, 3))
    sides = np.cross(lights.corners[:, 1] - lights.corners[:, 0], lights.corners[:, 2] - lights.corners[:, 0])
    least, most = np.zeros(81), np.zeros(81)
    for row, (low, high) in enumerate(cells.corners):
        arms = (low + inside * (high - low))[:, None] - centres
        heights = (arms * sides).sum(axis=2)
        least[row] = ((np.linalg.norm(arms, axis=2) < radii) & (heights > 0.0)).any(axis=0).sum()
        most[row] = (np.linalg.norm(np.clip(centres, low, high) - centres, axis=1) < radii).sum()
    assert (least <= cells.counts).all()
    assert (cells.counts <= most).all()
    assert cells.counts.sum() < 1.15 * least.sum()
    assert cells.counts.max() > cells.counts.min()


def test_boxes_with_a_tolerance_tell_the_expected_error_as_a_share_of_the_mean() -> None:
    lights = ball_of_lights()
    generator = np.random.default_rng(5)
    normals = generator.normal(size=(100, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    probes = SurfacePoints(generator.uniform(0.0, 1.0, (100, 3)), normals, np.zeros(100, np.int32))
    grid = LightGrid.bake(lights, BOUNDS, GridSettings(mode=TOLERANCE, tolerance=0.1), probes=probes)
    view = grid_view(grid, lights, BOUNDS)
    assert view.frame.cells_per_axis == BOXES_PER_AXIS
    cells = look(view, cells_around(view.frame, (0.5, 0.5, 0.5), 1))
    assert len(cells.counts) == 27
    assert cells.errors is not None
    middles = cells.corners.mean(axis=1)
    light = polygon_form_factor(probes.positions, probes.normals, lights.corners) @ lights.nominal_radiosity
    mean = light.sum(axis=1).mean()
    sides = normals[: len(middles)]
    tags = np.zeros(len(middles), np.int32)
    (_, structure), *_ = grid.structures
    of_tree = (structure.tree, structure.clusters, lights, lights.nominal_radiosity)
    found = cut_irradiance(*of_tree, middles, sides, tags).irradiance.sum(axis=1)
    exact = (polygon_form_factor(middles, sides, lights.corners) @ lights.nominal_radiosity).sum(axis=1)
    off = np.abs(found - exact) / mean
    assert np.quantile(off / cells.errors, 0.9) < 1.0
    assert cells.errors.mean() < 10.0 * off.mean()
    assert (cells.errors > 0.0).all()
    assert (cells.errors < 0.3).all()


def test_cells_around_a_corner_of_the_grid_are_those_that_there_are() -> None:
    lights = ball_of_lights(50)
    frame = grid_view(LightGrid.bake(lights, BOUNDS, GridSettings(mode=RANGE, grid=4)), lights, BOUNDS).frame
    assert sorted(map(tuple, cells_around(frame, (-7.0, 0.1, 9.0), 1).tolist())) == sorted(
        (x, y, z) for x in (0, 1) for y in (0, 1) for z in (2, 3)
    )


def test_lights_that_stand_and_lights_that_move_are_counted_together() -> None:
    lights = ball_of_lights()
    moving = replace(lights, dynamic=np.arange(len(lights)) % 2 == 0)
    settings = GridSettings(mode=RANGE, grid=3, range=3.0)
    views = [grid_view(LightGrid.bake(each, BOUNDS, settings), each, BOUNDS) for each in (lights, moving)]
    whole, parts = (look(view, cells_around(view.frame, (0.5, 0.5, 0.5), 1)).counts for view in views)
    assert (whole == parts).all()
