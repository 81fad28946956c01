# SPDX-License-Identifier: GPL-3.0-or-later
"""What baking a light grid and `check` say about it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, lights_from_triangles, split
from vlm_addon.core.light_grid import FEW_LIGHTS, RANGE, GridSettings
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.surface_points import random_surface_points
from vlm_addon.light_grid_bake import NOTICEABLE_LOSS, GridBake, bake_light_grid, check_lights

ROOM = box_room()


def walls(times: int) -> VirtualLightMesh:
    """The room's surfaces cut into 12 x 4^times lights, a little behind the surface and as bright as each other."""
    corners = split(np.concatenate([mesh.positions[mesh.triangles] for mesh in ROOM.meshes]), times)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    behind = 1e-3 * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return lights_from_triangles(corners - behind[:, None])


def with_error(bake: GridBake, share: float, points: int) -> GridBake:
    """The same, as if `points` of all points had been off by that share."""
    found = bake.error.full.copy()
    # Bright points, so that the share is of their own irradiance.
    bright = np.argsort(found.sum(axis=1))[len(found) - points :]
    found[bright] *= 1.0 - share
    return replace(bake, error=replace(bake.error, found=found, in_range=found))


@pytest.fixture(scope="module")
def many() -> GridBake:
    lights = walls(3)
    assert len(lights) > FEW_LIGHTS
    return bake_light_grid(ROOM, lights, GridSettings(tolerance=0.05))


def test_a_tolerance_that_is_kept_is_no_finding(many: GridBake) -> None:
    assert many.findings == ()
    assert not many.all_lights_summed
    assert "renderers sum" not in many.summary()


def test_a_tolerance_is_judged_at_both_percentiles(many: GridBake) -> None:
    count = len(many.error.full)
    often, seldom = with_error(many, 0.06, count // 10), with_error(many, 0.4, count // 100)
    (finding,) = often.findings
    assert "6.0% or more at 5 % of the points, where 5.0% is allowed" in finding.problem
    assert "0.1 %" not in finding.problem
    (finding,) = seldom.findings
    assert "40.0% or more at 0.1 % of the points, where 15.0% is allowed" in finding.problem
    assert "at 5 %" not in finding.problem
    (finding,) = with_error(many, 0.4, count // 10).findings
    assert "at 5 %" in finding.problem
    assert "at 0.1 %" in finding.problem


def test_three_times_the_tolerance_may_happen_at_few_points(many: GridBake) -> None:
    assert with_error(many, 0.14, len(many.error.full) // 100).findings == ()


def test_clusters_are_not_judged_where_renderers_sum_all_lights() -> None:
    few = bake_light_grid(ROOM, walls(2), GridSettings(tolerance=0.02))
    assert few.grid.light_count <= FEW_LIGHTS
    assert with_error(few, 0.5, len(few.error.full) // 2).findings == ()
    assert f"renderers sum all of so few lights ({few.grid.light_count})" in few.summary()
    assert few.report()["all_lights_summed"] is True


def test_a_range_that_drops_everything_is_a_finding_that_says_how_much() -> None:
    settings = GridSettings(mode=RANGE, grid=4, range=0.0)
    bake = bake_light_grid(ROOM, walls(2), settings)
    assert bake.error.share_out_of_range > 0.99
    (finding,) = bake.findings
    assert f"{bake.error.share_out_of_range:.1%} of the irradiance" in finding.problem
    assert "beyond their range of 0" in finding.problem
    assert "the nature of range mode" in finding.problem
    assert finding in check_lights(ROOM, walls(2), settings)
    assert not bake.all_lights_summed


def test_a_range_that_reaches_all_is_no_finding() -> None:
    bake = bake_light_grid(ROOM, walls(1), GridSettings(mode=RANGE, grid=3, range=50.0))
    assert bake.error.share_lost < NOTICEABLE_LOSS
    assert bake.findings == ()


def test_overflow_and_range_are_told_apart() -> None:
    bake = bake_light_grid(ROOM, walls(2), GridSettings(mode=RANGE, grid=3, range=3.0, max_lights=4))
    by_range, by_overflow = bake.findings
    assert f"{bake.error.share_out_of_range:.1%}" in by_range.problem
    assert f"{bake.error.share_overflowed:.1%}" in by_overflow.problem
    assert bake.grid.overflow in by_overflow.problem


def test_the_report_tells_what_the_grid_expects_of_its_error(many: GridBake) -> None:
    """As a share, as the error itself is told; the estimate is judged in tests/core/test_light_tree_error.py."""
    assert many.expected is not None
    full = many.error.full.sum(axis=1)
    shares = many.expected / np.maximum(full, 0.1 * full.mean())
    told = many.report()["expected_point_error"]
    assert told["median"] == pytest.approx(np.median(shares), rel=1e-9)
    assert told["95 %"] == pytest.approx(np.percentile(shares, 95.0), rel=1e-9)
    points = random_surface_points(ROOM.meshes, len(full), seed=1).positions
    np.testing.assert_array_equal(many.expected, many.grid.expected_error(points))
    assert "expected_point_error" not in bake_light_grid(ROOM, walls(1), GridSettings(mode=RANGE, grid=3)).report()


def test_the_report_is_json(many: GridBake) -> None:
    report = many.report()
    assert json.loads(json.dumps(report)) == report
    assert report["all_lights_summed"] is False
