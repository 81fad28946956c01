# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles behind voxels, against every triangle one by one."""

from __future__ import annotations

import numpy as np
import pytest

from tests import voxel_scenes
from tests.voxel_scenes import soup, surface_points, torus
from vlm_addon.core.brick_triangles import (
    ALL_EXACT,
    EDGE_SHARE,
    LIFT_SHARE,
    build_exact_octree,
    crossings,
    first_crossings,
    lattice_step,
    points_see,
    segments_open,
)
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.octree_march import surfaces_see
from vlm_addon.core.triangle_box import triangles_meet_cubes
from vlm_addon.core.voxel_octree import build_octree

DEPTH = 5
SIZE = float(1 << DEPTH)


@pytest.fixture(scope="module", params=["soup", "torus"])
def octree(request):
    shape = soup(80, DEPTH, np.random.default_rng(0)) if request.param == "soup" else torus(DEPTH, sides=(24, 12))
    return build_exact_octree(shape, DEPTH)


def ways(count, rng):
    starts = rng.uniform(0.0, SIZE, (count, 3))
    return starts, np.clip(
        starts + rng.normal(size=(count, 3)) * SIZE * 2.0 ** rng.uniform(-4.0, 0.0, (count, 1)), 0, SIZE
    )


def test_lists_hold_the_triangles_that_meet_each_voxel(octree):
    voxels = octree.tree.voxels()
    for index in np.random.default_rng(1).choice(len(voxels), 200, replace=False):
        centres = np.repeat(voxels[index : index + 1] + 0.5, len(octree.places), axis=0)
        listed = octree.triangles[octree.starts[index] : octree.starts[index + 1]]
        assert listed.tolist() == np.flatnonzero(triangles_meet_cubes(octree.places, centres, 0.5)).tolist()


def test_the_tree_is_that_of_the_voxels_alone(octree):
    expected = build_octree(octree.places, DEPTH)
    assert np.array_equal(octree.tree.nodes, expected.nodes)
    assert np.array_equal(octree.tree.bricks, expected.bricks)


def test_nothing_has_no_lists():
    octree = build_exact_octree(np.zeros((0, 3, 3)), DEPTH)
    assert octree.starts.tolist() == [0]
    assert segments_open([octree], *ways(20, np.random.default_rng(2))).all()


def test_corners_outside_are_refused():
    with pytest.raises(InvalidInput, match="triangle 0"):
        build_exact_octree(np.full((1, 3, 3), SIZE + 1.0), DEPTH)


def test_one_crossing_is_that_of_another_method():
    rng = np.random.default_rng(3)
    corners = rng.uniform(0.0, SIZE, (4000, 3, 3))
    starts, ends = rng.uniform(0.0, SIZE, (2, 4000, 3))
    found = crossings(starts, ends, corners)
    each = [
        voxel_scenes.crossings(starts[row : row + 1], ends[row : row + 1], corners[row : row + 1])[0][0]
        for row in range(len(corners))
    ]
    assert found == pytest.approx(np.array(each), abs=1e-9)
    assert 100 < np.isfinite(found).sum() < 3900


@pytest.mark.parametrize(("outside", "meets"), [(0.5, True), (4.0, False)])
def test_slack_reaches_so_far_outside_an_edge(outside, meets):
    slack = EDGE_SHARE * SIZE
    corners = np.array([[[4.0, 4.0, 8.0], [20.0, 4.0, 8.0], [4.0, 20.0, 8.0]]])
    start = np.array([[10.0, 4.0 - outside * slack, 2.0]])
    assert np.isfinite(crossings(start, start + np.array([0.0, 0.0, 10.0]), corners, slack))[0] == meets


def test_first_crossings_are_those_of_all_triangles(octree):
    starts, ends = ways(3000, np.random.default_rng(4))
    fractions, first = first_crossings(octree, starts, ends)
    expected, triangle = voxel_scenes.crossings(starts, ends, octree.places)
    same = np.isclose(fractions, expected, atol=1e-6) | (np.isinf(fractions) & np.isinf(expected))
    # The others pass an edge within the slack.
    assert (~same).mean() <= 1e-3
    hit = same & np.isfinite(fractions)
    assert (first[hit] != triangle[hit]).mean() <= 1e-2
    assert (first[np.isinf(fractions)] == -1).all()
    assert 0.1 < hit.mean() < 0.9


def test_of_two_triangles_in_one_place_the_first_is_met():
    one = np.array([[4.0, 4.0, 8.0], [20.0, 4.0, 8.0], [4.0, 20.0, 8.0]])
    octree = build_exact_octree(np.stack([one + np.array([0.0, 0.0, 4.0]), one[[1, 2, 0]], one]), DEPTH)
    assert first_crossings(octree, np.array([[8.0, 8.0, 2.0]]), np.array([[8.0, 8.0, 20.0]]))[1].tolist() == [1]


def pairs(octree, count, seed):
    rng = np.random.default_rng(seed)
    points, others = (surface_points(octree.places, count, rng) for _ in range(2))
    way = others[0] - points[0]
    facing = ((way * points[1]).sum(axis=1) > 1e-3) & ((way * others[1]).sum(axis=1) < -1e-3)
    return tuple(values[facing] for values in (*points, *others))


def test_surface_points_see_as_by_all_triangles(octree):
    points = pairs(octree, 6000, 5)
    found = points_see([octree], *points, ALL_EXACT)
    lift = LIFT_SHARE * SIZE
    exact = voxel_scenes.crossings(points[0] + lift * points[1], points[2] + lift * points[3], octree.places)[0]
    assert (found != np.isinf(exact)).mean() <= 1e-3
    assert 0 < found.sum() < len(found)


@pytest.mark.parametrize("exact_reach", [1, 3])
def test_a_short_reach_is_wrong_less_often_than_voxels_alone(octree, exact_reach):
    points = pairs(octree, 4000, 6)
    found, exact = (points_see([octree], *points, reach) for reach in (exact_reach, ALL_EXACT))
    voxels = surfaces_see([octree.tree], *points)
    assert (exact & ~found).sum() <= (exact & ~voxels).sum()
    assert (found & ~exact).sum() <= (voxels & ~exact).sum()
    assert (found != exact).sum() < (voxels != exact).sum()


def test_two_trees_block_as_one_of_both():
    rng = np.random.default_rng(7)
    shapes = [soup(40, DEPTH, rng) for _ in range(2)]
    starts, ends = ways(2000, rng)
    apart = segments_open([build_exact_octree(shape, DEPTH) for shape in shapes], starts, ends)
    assert np.array_equal(apart, segments_open([build_exact_octree(np.concatenate(shapes), DEPTH)], starts, ends))


def test_the_lattice_is_as_fine_as_float32():
    for depth in (3, 7, 10):
        last = np.float32(1 << depth)
        assert lattice_step(depth) == float(last - np.nextafter(last, np.float32(0.0)))
