# SPDX-License-Identifier: GPL-3.0-or-later
"""The octree of a scene: static and dynamic objects apart, kept as long as nothing changes, the same in local space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.octree_rays import BINDING, TRIANGLE_BINDING, ask, ask_exact, bind, clear_on_device
from tests.render.rooms import quad
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.octree_march import segments_clear
from vlm_addon.core.scene import Material, SceneSnapshot
from vlm_addon.core.voxel_octree import build_octree
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.scene_octree import scene_octree

RESOLUTION = 32


def scene(height=1.0, dynamic=True, alpha=1.0):
    """A floor of 4 m, a wall, and a plate over the floor that may move."""
    floor, wall = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), quad((-2, 2, 0), (4, 0, 0), (0, 0, 3))
    plate = replace(quad((-1, -1, height), (2, 0, 0), (0, 2, 0), material=1), dynamic=dynamic)
    materials = (Material("solid"), Material("plate", alpha=alpha))
    return SceneSnapshot("room", meshes=(floor, wall, plate), materials=materials)


def made(device, snapshot, kept, resolution=RESOLUTION):
    with device.current() as context:
        return scene_octree(context, device.shaders, kept, snapshot, resolution)


def corners(snapshot):
    return np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes])


def segments(frame, count=3000):
    rng = np.random.default_rng(0)
    size = float(frame.resolution)
    return tuple(rng.uniform(0.0, size, (count, 3)).astype(np.float32) for _ in range(2))


def test_static_and_dynamic_trees_block_as_one_of_all(device):
    kept, snapshot = Kept(), scene()
    octree = made(device, snapshot, kept)
    assert len(octree.trees) == 2
    one = build_octree(octree.frame.voxels(corners(snapshot)), octree.frame.depth)
    bind(device, octree.buffer)
    starts, ends = segments(octree.frame)
    found = clear_on_device(device, starts, ends)
    assert (found != segments_clear(one, starts, ends)).mean() < 1e-3
    assert 0.1 < found.mean() < 0.9


def test_only_what_moves_is_built_again(device):
    kept = Kept()
    for height in (1.0, 1.0, 1.5, 2.0, 2.0):
        snapshot = scene(height)
        octree = made(device, snapshot, kept)
        with device.current():
            found = octree.trees[1].read()
        places = octree.frame.voxels(snapshot.meshes[2].positions[snapshot.meshes[2].triangles])
        assert np.array_equal(found.bricks, build_octree(places, octree.frame.depth).bricks)
    assert kept.built["static_octree"] == 1
    assert kept.built["dynamic_octree"] == 3
    assert kept.built["joined_octree"] == 3


def test_a_scene_that_does_not_move_is_one_tree(device):
    octree = made(device, scene(dynamic=False), Kept())
    assert len(octree.trees) == len(octree.lists) == 1
    assert octree.buffer is octree.trees[0].buffer
    assert octree.triangles is octree.lists[0].buffer


def coloured(snapshot, mesh, colour):
    """`snapshot` with another reflectance of one of its meshes."""
    meshes = list(snapshot.meshes)
    reflectance = np.full((len(meshes[mesh].triangles), 3), colour, np.float32)
    meshes[mesh] = replace(meshes[mesh], reflectance=reflectance)
    return replace(snapshot, meshes=tuple(meshes))


def test_first_hits_are_those_of_all_triangles_and_their_colours(device):
    """Down to the plate, which moves, and beside it to the floor."""
    kept = Kept()
    snapshot = coloured(coloured(scene(), 0, 0.25), 2, 0.75)
    octree = made(device, snapshot, kept)
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-1.9, 1.9, (500, 2)), np.full(500, 2.0)])
    with device.current():
        octree.bind(BINDING, TRIANGLE_BINDING)
    inputs = {"p": octree.frame.voxels(points), "d": np.tile([[0.0, 0.0, -1.0]], (500, 1))}
    found = ask_exact(device, "vec4(octree_first_hit(p, vec3(0.0), d).reflectance, 0.0)", inputs, 4)[:, 0]
    over_plate = (np.abs(points[:, :2]) < 1.0).all(axis=1)
    assert np.array_equal(found, np.where(over_plate, 0.75, 0.25))
    assert 20 < over_plate.sum() < 480


def test_another_colour_is_built_again(device):
    kept, snapshot = Kept(), scene()
    for colour in (0.25, 0.25, 0.5):
        made(device, coloured(snapshot, 2, colour), kept)
    assert kept.built["static_octree"] == 1
    assert kept.built["dynamic_octree"] == 2


def test_what_is_wholly_transparent_is_left_out(device):
    kept = Kept()
    snapshot = scene(dynamic=False, alpha=0.0)
    octree = made(device, snapshot, kept)
    with device.current():
        found = octree.trees[0].read()
    rest = replace(snapshot, meshes=snapshot.meshes[:2])
    assert np.array_equal(found.bricks, build_octree(octree.frame.voxels(corners(rest)), octree.frame.depth).bricks)
    made(device, scene(dynamic=False, alpha=0.5), kept)
    assert kept.built["static_octree"] == 2


def test_places_in_local_space_are_the_frames(device):
    snapshot = scene()
    octree, space = made(device, snapshot, Kept()), make_local_space(snapshot)
    bind(device, octree.buffer)
    points = np.random.default_rng(1).uniform(-2.0, 3.0, (100, 3))
    local = space.local_points(points).astype(np.float32)
    frame = ", ".join(repr(value) for value in octree.uniform(space))
    found = ask(device, f"octree_place(p, vec4({frame}))", {"p": local}, 3)
    assert found == pytest.approx(octree.frame.voxels(points), abs=1e-4)


def test_counters_tell_nodes_and_memory(device):
    octree = made(device, scene(), Kept())
    counters = octree.counters()
    assert counters["octree_nodes"] == sum(tree.node_count for tree in octree.trees) > 2
    words = sum(tree.node_count + 2 * tree.brick_count for tree in octree.trees)
    assert counters["octree_mb"] == pytest.approx(4e-6 * words)
    assert counters["octree_triangle_mb"] > 0.0
    assert counters["octree_device_mb"] >= counters["octree_mb"] + counters["octree_triangle_mb"]


def test_an_empty_scene_blocks_nothing(device):
    octree = made(device, SceneSnapshot("nothing"), Kept())
    bind(device, octree.buffer)
    assert clear_on_device(device, *segments(octree.frame, 100)).all()


def test_other_resolutions_are_refused(device):
    with pytest.raises(InvalidInput, match="voxel resolution"):
        made(device, scene(), Kept(), 100)
