# SPDX-License-Identifier: GPL-3.0-or-later
"""The octree of voxels: which voxels it has, how it is laid out, and what it refuses."""

import numpy as np
import pytest

from tests.voxel_scenes import soup, sphere
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.triangle_box import triangles_meet_cubes
from vlm_addon.core.voxel_frame import RESOLUTIONS, make_voxel_frame
from vlm_addon.core.voxel_octree import build_octree, codes_of, tree_of_codes


def brute_force(places, depth, growth=0.0):
    """(n, n, n) every voxel against every triangle."""
    size = 1 << depth
    cells = np.stack(np.meshgrid(*[np.arange(size)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    found = np.zeros(len(cells), bool)
    for triangle in places:
        many = np.broadcast_to(triangle, (len(cells), 3, 3))
        found |= triangles_meet_cubes(many, cells + 0.5, 0.5 + growth)
    return found.reshape(size, size, size)


def dense(tree):
    size = 1 << tree.depth
    grid = np.zeros((size, size, size), bool)
    grid[tuple(tree.voxels().T)] = True
    return grid


@pytest.mark.parametrize("depth", [3, 4])
@pytest.mark.parametrize("growth", [0.0, 0.3])
def test_voxels_are_those_of_brute_force(depth, growth):
    places = soup(60, depth, np.random.default_rng(depth))
    assert np.array_equal(dense(build_octree(places, depth, growth)), brute_force(places, depth, growth))


def test_triangles_alone_have_all_voxels_they_touch():
    """A triangle begins on the level of its own size: none may begin too deep, wherever it lies."""
    rng = np.random.default_rng(2)
    for triangle in soup(60, 4, rng):
        assert np.array_equal(dense(build_octree(triangle[None], 4)), brute_force(triangle[None], 4))


def test_a_point_on_a_corner_of_voxels_is_in_all_eight():
    tree = build_octree(np.full((1, 3, 3), 4.0), 3)
    assert sorted(map(tuple, tree.voxels().tolist())) == [(x, y, z) for x in (3, 4) for y in (3, 4) for z in (3, 4)]


def test_nodes_are_linked_as_described():
    """From the root every voxel is found by the words alone, and every node is reached once."""
    tree = build_octree(sphere(5), 5)
    reached, voxels = [], []

    def walk(level, index, corner):
        side = 1 << (tree.depth - level)
        if side == 4:
            mask = int(tree.bricks[index])
            for bit in range(64):
                if mask >> bit & 1:
                    octants = (bit >> 3, bit & 7)
                    offset = [2 * (octants[0] >> axis & 1) + (octants[1] >> axis & 1) for axis in range(3)]
                    voxels.append(tuple(np.add(corner, offset).tolist()))
            return
        reached.append(index)
        word = int(tree.nodes[index])
        child = word >> 8
        for octant in range(8):
            if word >> octant & 1:
                walk(level + 1, child, [c + side // 2 * (octant >> axis & 1) for axis, c in enumerate(corner)])
                child += 1

    walk(0, 0, [0, 0, 0])
    assert sorted(reached) == list(range(len(tree.nodes)))
    assert voxels == [tuple(v) for v in tree.voxels().tolist()]
    assert len(voxels) == tree.voxel_count == len(set(voxels))


def test_each_level_is_in_the_order_of_the_curve_and_voxels_make_the_same_tree():
    tree = build_octree(sphere(5), 5)
    codes = codes_of(tree.voxels())
    assert (np.diff(codes) > 0).all()
    again = tree_of_codes(codes, 5)
    assert np.array_equal(again.nodes, tree.nodes)
    assert np.array_equal(again.bricks, tree.bricks)
    assert tree.level_starts.tolist()[0] == 0
    assert tree.level_starts[-1] == len(tree.nodes)


def test_bytes_are_four_for_a_node_and_eight_for_a_brick():
    tree = build_octree(sphere(6), 6)
    assert tree.nbytes == 4 * len(tree.nodes) + 8 * len(tree.bricks)
    # The document's nodes take 16 bytes for each of the eight children of each node, voxels included.
    assert tree.nbytes < tree.voxel_count


@pytest.mark.parametrize("depth", [3, 7])
def test_nothing_is_one_root_without_children(depth):
    tree = build_octree(np.zeros((0, 3, 3)), depth)
    assert tree.nodes.tolist() == [0]
    assert tree.voxel_count == 0
    assert len(tree.voxels()) == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.01, 8.01])
def test_corners_outside_are_refused_by_their_triangle(bad):
    places = np.ones((3, 3, 3))
    places[1, 2, 0] = bad
    with pytest.raises(InvalidInput, match="triangle 1"):
        build_octree(places, 3)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_a_frame_holds_its_bounds_with_half_a_voxel_around_the_longest_axis(resolution):
    low, high = np.array([-3.0, 2.0, 1e3]), np.array([4.0, 2.5, 1003.0])
    frame = make_voxel_frame((low, high), resolution)
    assert frame.resolution == resolution
    assert frame.voxels(low) == pytest.approx(0.5)
    assert frame.voxels(high)[0] == pytest.approx(resolution - 0.5)
    assert (frame.voxels(high) <= resolution).all()
    assert frame.points(frame.voxels(high)) == pytest.approx(high)


def test_walls_on_the_bounds_fill_one_layer_of_voxels():
    wall = np.array([[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0]]])
    frame = make_voxel_frame(([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]), 16)
    assert set(build_octree(frame.voxels(wall), frame.depth).voxels()[:, 0].tolist()) == {0}


def test_a_frame_of_a_point_has_a_size():
    frame = make_voxel_frame((np.ones(3), np.ones(3)), 8)
    assert frame.voxels(np.ones(3)) == pytest.approx(0.5)


@pytest.mark.parametrize("resolution", [0, 7, 100, 2048])
def test_other_resolutions_are_refused(resolution):
    with pytest.raises(InvalidInput, match="voxel resolution"):
        make_voxel_frame((np.zeros(3), np.ones(3)), resolution)


def test_bounds_that_are_not_finite_are_refused():
    with pytest.raises(InvalidInput):
        make_voxel_frame((np.zeros(3), np.full(3, np.nan)), 64)
