# SPDX-License-Identifier: GPL-3.0-or-later
"""Octrees by compute shaders: the voxels of core's oracle, in core's layout, at no more memory each time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.voxel_scenes import box, soup, sphere, torus
from vlm_addon.core.brick_triangles import build_exact_octree
from vlm_addon.core.errors import DeviceError, InvalidInput
from vlm_addon.core.voxel_octree import build_octree, codes_of, tree_of_codes
from vlm_addon.render import growing_buffer
from vlm_addon.render.growing_buffer import GrowingBuffer
from vlm_addon.render.passes.voxelize import VoxelizePass, growth_of, triangle_records

BORDER = 1e-3
"""Voxels: how far from a triangle a voxel may be that is found and should not be."""


@pytest.fixture
def build(device):
    """build(places, depth): the tree on the host, built by shaders."""
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        yield lambda places, depth: builder.build(places, depth, GrowingBuffer(context, "octree")).read()


def require_between(found, places, depth):
    """The voxels are all of the float64 oracle's and within those grown by BORDER."""
    codes = codes_of(found.voxels())
    assert np.isin(codes_of(build_octree(places, depth).voxels()), codes).all()
    assert np.isin(codes, codes_of(build_octree(places, depth, BORDER).voxels())).all()


@pytest.mark.parametrize("depth", [3, 6, 7])
def test_voxels_of_a_soup_are_those_of_the_oracle(build, depth):
    places = soup(250, depth, np.random.default_rng(depth))
    require_between(build(places, depth), places, depth)


@pytest.mark.parametrize("shape", [sphere, torus])
def test_voxels_of_closed_surfaces(build, shape):
    require_between(build(shape(7), 7), shape(7), 7)


def test_large_triangles_in_the_highest_resolution(build):
    """One far from the origin, aslant, and one across the cube on faces of voxels, which touches both their sides."""
    depth, size = 10, 1024.0
    slanted = np.array([[[size, 1e-3, 700.3], [size - 260.0, 3.0, size], [980.0, 9.0, 701.0]]])
    found = build(slanted, depth)
    require_between(found, slanted, depth)
    flat = np.array([[[0.0, 0.0, 512.0], [size, 0.0, 512.0], [0.0, 40.0, 512.0]]])
    assert set(build(flat, depth).voxels()[:, 2].tolist()) == {511, 512}


def test_words_are_those_of_core_on_every_run(build):
    """Nodes and bricks stand where core puts them, whatever order the device works in."""
    places = soup(300, 6, np.random.default_rng(1))
    first, second = build(places, 6), build(places, 6)
    expected = tree_of_codes(codes_of(first.voxels()), 6)
    for found in (first, second):
        assert np.array_equal(found.nodes, expected.nodes)
        assert np.array_equal(found.bricks, expected.bricks)
        assert np.array_equal(found.level_starts, expected.level_starts)


@pytest.mark.parametrize("depth", [3, 8])
def test_nothing_makes_a_root_without_children(build, depth):
    found, expected = build(np.zeros((0, 3, 3)), depth), build_octree(np.zeros((0, 3, 3)), depth)
    assert np.array_equal(found.nodes, expected.nodes)
    assert np.array_equal(found.level_starts, expected.level_starts)
    assert found.voxel_count == 0


def test_corners_outside_are_refused(build):
    with pytest.raises(InvalidInput, match="triangle 0"):
        build(np.full((1, 3, 3), 8.5), 3)


def test_growth_is_half_of_what_the_border_allows():
    assert 2.0 * growth_of(10) < BORDER


def test_lists_that_no_block_holds_are_refused_and_the_next_build_is_right(device, monkeypatch):
    with device.current() as context:
        builder, target = VoxelizePass(context, device.shaders), GrowingBuffer(context, "octree")
        ball = sphere(6)
        with monkeypatch.context() as patched:
            patched.setattr(growing_buffer, "_limit", lambda context: 4096)
            with pytest.raises(DeviceError, match="lower resolution"):
                builder.build(ball, 6, target)
        found = builder.build(ball, 6, target).read()
    assert np.array_equal(found.bricks, build_octree(ball, 6).bricks)


def test_a_tree_that_no_block_holds_is_refused(device):
    with device.current() as context:
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        with pytest.raises(DeviceError, match="the tree needs a block"):
            GrowingBuffer(context, "the tree").of(limit + 4)


def test_a_target_grows_and_never_shrinks(device):
    """From a small ball to a large one and back: the words are right each time, in the larger buffer."""
    with device.current() as context:
        builder, target = VoxelizePass(context, device.shaders), GrowingBuffer(context, "octree")
        sizes = []
        for radius in (0.02, 0.45, 0.02):
            ball = sphere(6, radius=radius, rings=8)
            tree = builder.build(ball, 6, target).read()
            assert tree.voxel_count == build_octree(ball, 6).voxel_count
            sizes.append(target.nbytes)
    assert sizes[0] < sizes[1] == sizes[2]


def test_fifty_builds_of_what_moves_take_no_more_memory(device):
    """Of a static room and a ball that moves: what the pass counts, and what a software renderer's process takes."""
    rng = np.random.default_rng(0)
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        targets = [GrowingBuffer(context, "octree") for _ in range(3)]
        room = builder.build(box((2.5, 2.5, 2.5), (125.0, 120.0, 110.0)), 7, targets[0])
        taken, resident = [], []
        for _ in range(50):
            ball = sphere(7, radius=0.2, centre=rng.uniform(0.3, 0.7, 3))
            moved = builder.build(ball, 7, targets[1])
            builder.join((room, moved), targets[2])
            taken.append(builder.pool.nbytes + sum(target.nbytes for target in targets))
            resident.append(resident_bytes())
        assert np.array_equal(room.read().bricks, build_octree(box((2.5, 2.5, 2.5), (125.0, 120.0, 110.0)), 7).bricks)
    assert len(set(taken[5:])) == 1
    # Half of what 39 builds take, if each kept what it works in.
    assert resident[-1] - resident[10] < 20 * builder.pool.nbytes


def resident_bytes():
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * 4096 if statm.exists() else 0


def test_join_copies_both_trees(device):
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        trees = [builder.build(shape(6), 6, GrowingBuffer(context, "octree")) for shape in (sphere, torus)]
        words = np.frombuffer(builder.join(trees, GrowingBuffer(context, "octree")).read(), np.uint32)
        assert words[:2].tolist() == [2, 6]
        for index, tree in enumerate(trees):
            first, bricks = words[2 + 2 * index : 4 + 2 * index].tolist()
            host = tree.read()
            assert np.array_equal(words[first : first + tree.node_count], host.nodes)
            assert np.array_equal(words[bricks : bricks + 2 * tree.brick_count], host.bricks.view(np.uint32))


def lists_of(device, shape, depth, reflectance=None, target=None):
    colours = np.zeros((len(shape), 3), np.float32) if reflectance is None else reflectance
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        targets = GrowingBuffer(context, "octree"), target or GrowingBuffer(context, "triangles")
        tree, lists = builder.build_with_lists(shape, colours, depth, *targets)
        return tree.read(), lists, lists.read()


@pytest.mark.parametrize("shape", [soup(250, 6, np.random.default_rng(6)), torus(6), np.zeros((0, 3, 3))])
def test_lists_hold_the_triangles_of_each_voxel(device, shape):
    """Those of the oracle, once each, and none but those of the oracle with voxels that are larger by BORDER."""
    tree, _, (starts, triangles, _records) = lists_of(device, shape, 6)
    codes = codes_of(tree.voxels())
    assert len(starts) == len(codes) + 1
    pairs = np.stack([np.repeat(codes, np.diff(starts.astype(int))), triangles.astype(int)], axis=1)
    keys = pairs[:, 0] * (len(shape) + 1) + pairs[:, 1]
    assert len(np.unique(keys)) == len(keys)
    for growth, found, among in ((0.0, None, keys), (BORDER, keys, None)):
        octree = build_exact_octree(shape, 6, growth)
        listed = np.repeat(octree.codes, np.diff(octree.starts)) * (len(shape) + 1) + octree.triangles
        assert np.isin(listed if found is None else found, listed if among is None else among).all()


def test_records_are_corners_normals_and_reflectance(device):
    shape, colours = torus(6), np.random.default_rng(7).uniform(size=(len(torus(6)), 3)).astype(np.float32)
    records = lists_of(device, shape, 6, colours)[2][2]
    assert np.array_equal(records[:, :3], triangle_records(shape, 6))
    assert np.array_equal(records[:, 3, :3], colours)


def test_the_tree_is_the_same_with_and_without_lists(device):
    tree = lists_of(device, torus(6), 6)[0]
    with device.current() as context:
        alone = VoxelizePass(context, device.shaders).build(torus(6), 6, GrowingBuffer(context, "octree")).read()
    assert np.array_equal(tree.nodes, alone.nodes)
    assert np.array_equal(tree.bricks, alone.bricks)


def test_lists_grow_and_never_shrink(device):
    with device.current() as context:
        target = GrowingBuffer(context, "triangles")
    sizes = []
    for radius in (0.02, 0.45, 0.02):
        ball = sphere(6, radius=radius, rings=8)
        starts, triangles, _ = lists_of(device, ball, 6, target=target)[2]
        assert starts[-1] == len(triangles)
        assert set(triangles.tolist()) == set(range(len(ball)))
        sizes.append(target.nbytes)
    assert sizes[0] < sizes[1] == sizes[2]


def test_join_lists_copies_both(device):
    with device.current() as context:
        builder, lists = VoxelizePass(context, device.shaders), []
        for shape in (sphere(6, rings=8), torus(6)):
            targets = GrowingBuffer(context, "octree"), GrowingBuffer(context, "triangles")
            lists.append(builder.build_with_lists(shape, np.zeros((len(shape), 3)), 6, *targets)[1])
        words = np.frombuffer(builder.join_lists(lists, GrowingBuffer(context, "joined")).read(), np.uint32)
        for index, part in enumerate(lists):
            _, starts, triangles, records = words[4 * index : 4 * index + 4].tolist()
            expected = part.read()
            assert np.array_equal(words[starts : starts + part.voxel_count + 1], expected[0])
            assert np.array_equal(words[triangles : triangles + part.pair_count], expected[1])
            assert np.array_equal(
                words[records : records + 16 * part.triangle_count], expected[2].ravel().view(np.uint32)
            )


def test_lists_that_no_block_holds_are_refused(device, monkeypatch):
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        target, lists = GrowingBuffer(context, "octree"), GrowingBuffer(context, "its triangles")
        ball = sphere(6)
        # As much as the voxelisation itself needs.
        monkeypatch.setattr(growing_buffer, "_limit", lambda context: 160_000)
        with pytest.raises(DeviceError, match="its triangles needs a block"):
            builder.build_with_lists(ball, np.zeros((len(ball), 3)), 6, target, lists)


def test_trees_of_different_depths_are_not_joined(device):
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        trees = [builder.build(sphere(depth), depth, GrowingBuffer(context, "octree")) for depth in (5, 6)]
        with pytest.raises(ValueError, match="same depth"):
            builder.join(trees, GrowingBuffer(context, "octree"))
