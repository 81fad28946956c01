# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks through the octree: every occupied voxel of the way is seen, no closed surface lets one through."""

import numpy as np
import pytest

from tests.voxel_scenes import box, convex_crossing, meets_any_box, soup, sphere
from vlm_addon.core.octree_march import boxes_at, lifted, reaches, segments_clear, surfaces_see
from vlm_addon.core.voxel_octree import build_octree

# Of a voxel: what float64 leaves of a coordinate, and of a float32 one, in cubes of 64 voxels.
ROUNDING = {np.float64: 1e-12, np.float32: 1e-4}


def random_segments(count, size, rng):
    """Ends within the cube and around it, on faces of voxels, along axes and diagonals, of every length."""
    starts = rng.uniform(-0.2 * size, 1.2 * size, (count, 3))
    ends = starts + rng.normal(size=(count, 3)) * size * 2.0 ** rng.uniform(-8.0, 1.0, (count, 1))
    starts[::4], ends[::4] = np.round(starts[::4]), np.round(ends[::4])
    ends[1::8, :2] = starts[1::8, :2]
    ends[2::8, 0] = starts[2::8, 0]
    ends[3::16] = starts[3::16] + (ends - starts)[3::16, :1]
    return starts, ends


def test_boxes_are_the_largest_of_the_tree_that_hold_a_voxel():
    tree = build_octree(soup(20, 5, np.random.default_rng(0)), 5)
    grid = np.zeros((32, 32, 32), bool)
    grid[tuple(tree.voxels().T)] = True
    cells = np.random.default_rng(1).integers(0, 32, (500, 3))
    boxes = boxes_at(tree, cells)
    assert np.array_equal(boxes.occupied, grid[tuple(cells.T)])
    for cell, low, high, occupied in zip(cells, boxes.low, boxes.high, boxes.occupied, strict=True):
        side = high[0] - low[0] + 1
        assert (high - low + 1 == side).all()
        assert (low % side == 0).all()
        assert ((cell >= low) & (cell <= high)).all()
        if occupied:
            assert side == 1
            continue
        assert not grid[tuple(slice(a, b + 1) for a, b in zip(low, high, strict=True))].any()
        parent = low // (2 * side) * (2 * side)
        assert grid[tuple(slice(a, a + 2 * side) for a in parent)].any()


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_a_way_is_clear_where_it_meets_no_occupied_voxel(kind):
    """Every voxel against every segment: blocked for a voxel that is smaller by rounding, clear for one larger."""
    rng = np.random.default_rng(2)
    tree = build_octree(soup(40, 4, rng), 4)
    starts, ends = (ends.astype(kind) for ends in random_segments(1600, 16.0, rng))
    found = segments_clear(tree, starts, ends)
    voxels, slack = tree.voxels(), ROUNDING[kind]
    exact = starts.astype(float), ends.astype(float)
    must_block = meets_any_box(*exact, voxels + slack, voxels + 1.0 - slack)
    may_block = meets_any_box(*exact, voxels - slack, voxels + 1.0 + slack)
    assert not (found & must_block).any()
    assert not (~found & ~may_block).any()
    assert 0.1 < found.mean() < 0.9


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_no_way_leads_through_a_closed_surface(kind):
    rng = np.random.default_rng(3)
    ball = sphere(6, rings=12)
    tree = build_octree(ball, 6)
    starts, ends = (ends.astype(kind) for ends in random_segments(10_000, 64.0, rng))
    crossing = convex_crossing(starts.astype(float), ends.astype(float), ball)
    assert crossing.sum() > 500
    assert not segments_clear(tree, starts, ends)[crossing].any()


def test_the_order_of_the_faces_may_be_any():
    """With fractions off by a tenth of a voxel and more a way still does not lead through a closed surface."""
    rng = np.random.default_rng(4)
    ball = sphere(5, rings=8)
    tree = build_octree(ball, 5)
    starts, ends = random_segments(4000, 32.0, rng)
    crossing = convex_crossing(starts, ends, ball)
    # float16 holds 11 bits, so places in the cube are off by up to 2^-7 and fractions by more.
    coarse = starts.astype(np.float16), ends.astype(np.float16)
    moved = convex_crossing(coarse[0].astype(float), coarse[1].astype(float), ball)
    with np.errstate(over="ignore"):
        clear = segments_clear(tree, *coarse)
    assert (crossing & moved).sum() > 200
    assert not clear[crossing & moved].any()


def test_ways_far_outside_end():
    tree = build_octree(sphere(5), 5)
    far = np.array([1e30, -1e30, 5e5, 40.0, -3.0])
    starts, ends = (np.stack(np.meshgrid(far, far, far), axis=-1).reshape(-1, 3)[::step] for step in (1, -1))
    assert segments_clear(tree, starts, starts).all()
    assert not segments_clear(tree, np.array([[-1e5, 15.0, 16.0]]), np.array([[1e5, 15.0, 16.0]])).any()
    assert segments_clear(tree, np.array([[-1e5, 15.0, 50.0]]), np.array([[1e5, 15.0, 50.0]])).all()
    assert segments_clear(tree, starts, ends).dtype == bool


def unit(count, rng):
    normals = rng.normal(size=(count, 3))
    normals[::5] = np.round(rng.uniform(-1.5, 1.5, (len(normals[::5]), 3))) + np.array((0.0, 0.0, 0.1))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_a_voxel_at_a_points_reach_does_not_touch_its_plane():
    """Highest and lowest height of a voxel over the plane are apart by what the reach is made of."""
    rng = np.random.default_rng(5)
    normals = unit(2000, rng)
    places = rng.uniform(0.0, 64.0, (2000, 3))
    raised = places + normals * reaches(normals)[:, None]
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    heights = np.einsum("nci,ni->nc", np.floor(raised)[:, None] + corners - places[:, None], normals)
    assert (heights.min(axis=1) > 0.0).all()
    assert heights.min() < 0.1


def test_ways_begin_over_both_planes():
    rng = np.random.default_rng(6)
    normals, other_normals = unit(4000, rng), unit(4000, rng)
    places = rng.uniform(0.0, 64.0, (4000, 3))
    others = places + rng.normal(size=(4000, 3)) * 2.0 ** rng.uniform(-3.0, 4.0, (4000, 1))
    begins = lifted(places, normals, others, other_normals)
    own = np.einsum("ij,ij->i", normals, begins - places)
    over = np.einsum("ij,ij->i", other_normals, begins - others)
    cosine = np.einsum("ij,ij->i", normals, other_normals)
    assert (own >= reaches(normals) - 1e-9).all()
    assert (over >= reaches(other_normals) - 1e-9)[cosine > -0.86].all()
    before = np.einsum("ij,ij->i", other_normals, places - others)
    # Only as far as the document of this function says, from a point that is not behind the other's plane.
    moved = np.linalg.norm(begins - places, axis=1)
    in_front = (before >= 0.0) & (cosine > 0.0)
    assert (moved <= reaches(normals) + 2.0 * reaches(other_normals) + 1e-9)[in_front].all()


def test_a_point_in_space_stays_where_it_is():
    places, nothing = np.full((1, 3), 7.0), np.zeros((1, 3))
    assert np.array_equal(lifted(places, nothing, places + 5.0, nothing), places)


@pytest.fixture(scope="module")
def room():
    """A closed room in the cube and points on its walls, floor and ceiling with their normals, inwards."""
    low, high = np.array([6.3, 9.1, 4.6]), np.array([57.2, 54.9, 50.7])
    rng = np.random.default_rng(7)
    # A third wall within a voxel of a way that runs along it cannot be told from one that is in its way.
    points = rng.uniform(low + 1.1, high - 1.1, (4000, 3))
    normals = np.zeros((4000, 3))
    rows, axis, side = np.arange(4000), rng.integers(0, 3, 4000), rng.integers(0, 2, 4000)
    points[rows, axis] = np.where(side == 1, high[axis], low[axis])
    normals[rows, axis] = 1.0 - 2.0 * side
    return build_octree(box(low, high), 6), points, normals


def test_all_of_an_empty_convex_room_sees_itself(room):
    tree, points, normals = room
    half = len(points) // 2
    ends = points[:half], normals[:half], points[half:], normals[half:]
    facing = (np.einsum("ij,ij->i", ends[1], ends[2] - ends[0]) > 0.0) & (
        np.einsum("ij,ij->i", ends[3], ends[0] - ends[2]) > 0.0
    )
    assert facing.sum() > 1000
    assert surfaces_see([tree], *ends)[facing].all()


def test_corners_of_a_room_see_each_other_across_the_edge(room):
    """Floor and wall within some voxels of where they meet, from a hundredth of a voxel on."""
    tree = room[0]
    steps = 10.0 ** np.linspace(-2.0, 1.0, 40)
    a, b = (grid.ravel() for grid in np.meshgrid(steps, steps))
    floor = np.stack([6.3 + a, np.full(len(a), 30.2), np.full(len(a), 4.6)], axis=1)
    wall = np.stack([np.full(len(a), 6.3), np.full(len(a), 31.9), 4.6 + b], axis=1)
    up, across = np.tile((0.0, 0.0, 1.0), (len(a), 1)), np.tile((1.0, 0.0, 0.0), (len(a), 1))
    assert surfaces_see([tree], floor, up, wall, across).all()


def test_two_trees_block_as_one(room):
    tree, points, normals = room
    plate = build_octree(box((30.0, 20.0, 20.0), (31.0, 40.0, 40.0)), 6)
    both = np.concatenate([box((6.3, 9.1, 4.6), (57.2, 54.9, 50.7)), box((30.0, 20.0, 20.0), (31.0, 40.0, 40.0))])
    half = len(points) // 2
    ends = points[:half], normals[:half], points[half:], normals[half:]
    joined = surfaces_see([build_octree(both, 6)], *ends)
    assert np.array_equal(surfaces_see([tree, plate], *ends), joined)
    assert not joined.all()
