# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/octree.glsl` against core/octree_march.py and against every voxel, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.octree_rays import ask, bind, build, clear_on_device
from tests.voxel_scenes import box, convex_crossing, meets_any_box, soup, sphere
from vlm_addon.core.octree_march import (
    boxes_at,
    cells_at,
    lifted,
    lifted_by,
    next_cells,
    reaches,
    segments_clear,
    surfaces_see,
)
from vlm_addon.render.growing_buffer import GrowingBuffer
from vlm_addon.render.passes.voxelize import VoxelizePass

DEPTH = 5
SIZE = float(1 << DEPTH)


@pytest.fixture
def tree(device):
    """A soup of triangles, bound, and the same tree on the host."""
    on_device, on_host = build(device, soup(60, DEPTH, np.random.default_rng(0)), DEPTH)
    yield on_host
    del on_device


def segments(count, rng, size=SIZE):
    starts = rng.uniform(-0.2 * size, 1.2 * size, (count, 3))
    ends = starts + rng.normal(size=(count, 3)) * size * 2.0 ** rng.uniform(-8.0, 1.0, (count, 1))
    starts[::4], ends[::4] = np.round(starts[::4]), np.round(ends[::4])
    ends[1::8, :2] = starts[1::8, :2]
    return starts.astype(np.float32), ends.astype(np.float32)


def unit(count, rng):
    normals = rng.normal(size=(count, 3))
    normals[::5] = np.eye(3)[rng.integers(0, 3, len(normals[::5]))]
    return (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)


def test_octree_place(device, tree):
    points = np.random.default_rng(1).normal(size=(100, 3)).astype(np.float32)
    found = ask(device, "octree_place(p, vec4(1.0, 2.0, 3.0, 4.0))", {"p": points}, 3)
    assert found == pytest.approx((points - (1.0, 2.0, 3.0)) * 4.0, abs=1e-5)


def test_octree_cell(device, tree):
    places = segments(500, np.random.default_rng(2))[0]
    places[0], places[1] = 1e30, -1e30
    assert np.array_equal(ask(device, "vec3(octree_cell(p))", {"p": places}, 3), cells_at(places))


def test_octree_octant(device, tree):
    cells = np.random.default_rng(3).integers(0, 32, (200, 3))
    for height in range(5):
        found = ask(device, f"float(octree_octant(ivec3(c), {height}u))", {"c": cells.astype(np.float32)})
        assert np.array_equal(found, (cells >> height & 1) @ [1, 2, 4])


@pytest.mark.parametrize("part", ["low", "high"])
def test_octree_box_and_octree_outside(device, tree, part):
    cells = np.random.default_rng(4).integers(-8, 40, (3000, 3))
    expected = boxes_at(tree, cells)
    inputs = {"c": cells.astype(np.float32)}
    found = ask(device, f"vec3(octree_box(0u, ivec3(c)).{part})", inputs, 3)
    assert np.array_equal(found, getattr(expected, part))
    occupied = ask(device, "float(octree_box(0u, ivec3(c)).occupied)", inputs)
    assert np.array_equal(occupied > 0.5, expected.occupied)
    outside = ((cells < 0) | (cells >= 32)).any(axis=1)
    alone = ask(device, f"vec3(octree_outside(ivec3(c), 32).{part})", inputs, 3)
    assert np.array_equal(alone[outside], found[outside])
    assert 100 < outside.sum() < 2900
    assert occupied.any()


def test_octree_box_of_either_tree_of_a_joined_buffer(device):
    places = np.random.default_rng(10).uniform(-2.0, SIZE + 2.0, (3000, 3)).astype(np.float32)
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        shapes = sphere(DEPTH, rings=10), box((3.0, 3.0, 20.0), (28.0, 28.0, 21.0))
        trees = [builder.build(shape, DEPTH, GrowingBuffer(context, "octree")) for shape in shapes]
        joined = builder.join(trees, GrowingBuffer(context, "octree"))
        each = [boxes_at(tree.read(), cells_at(places)).occupied for tree in trees]
    bind(device, joined)
    for tree, expected in enumerate(each):
        found = ask(device, f"float(octree_box({tree}u, octree_cell(p)).occupied)", {"p": places}) > 0.5
        assert np.array_equal(found, expected)
    assert (each[0] & ~each[1]).any()
    assert (each[1] & ~each[0]).any()


def test_octree_walk_begins_and_ends_in_the_voxels_of_its_ends(device, tree):
    starts, ends = segments(500, np.random.default_rng(11))
    for part, expected in (("cell", cells_at(starts)), ("last", cells_at(ends)), ("along", ends - starts)):
        found = ask(device, f"vec3(octree_walk(a, b).{part})", {"a": starts, "b": ends}, 3)
        assert np.array_equal(found, expected)


LEAVE = """
vec4 left_box(vec3 a, vec3 b) {
    OctreeWalk walk = octree_walk(a, b);
    VoxelBox box = octree_box(0u, walk.cell);
    octree_leave(walk, box.low, box.high);
    return vec4(walk.cell, float(!walk.ended));
}
vec4 next_box(vec3 a, vec3 b) {
    OctreeWalk walk = octree_walk(a, b);
    VoxelBox box = octree_next(0u, walk);
    return vec4(walk.cell, float(box.occupied));
}
"""


def test_octree_leave_is_the_step_of_core(device, tree):
    starts, ends = segments(4000, np.random.default_rng(12))
    found = ask(device, "left_box(a, b)", {"a": starts, "b": ends}, 4, LEAVE)
    cells = cells_at(starts)
    boxes = boxes_at(tree, cells)
    rows, moved = next_cells(np.arange(len(starts)), cells, boxes.low, boxes.high, starts, ends)
    assert np.array_equal(np.flatnonzero(found[:, 3]), rows)
    assert (found[rows, :3] != moved).any(axis=1).mean() < 1e-3
    assert 100 < len(rows) < 3900


def test_octree_next_stands_in_an_occupied_voxel_where_a_way_is_not_clear(device, tree):
    starts, ends = segments(2000, np.random.default_rng(13))
    found = ask(device, "next_box(a, b)", {"a": starts, "b": ends}, 4, LEAVE)
    clear = clear_on_device(device, starts, ends)
    assert np.array_equal(found[:, 3] > 0.5, ~clear)
    assert boxes_at(tree, found[~clear, :3].astype(np.int64)).occupied.all()


def test_octree_tree_clear_is_the_walk_of_core(device, tree):
    starts, ends = segments(4000, np.random.default_rng(5))
    found = ask(device, "float(octree_tree_clear(0u, a, b))", {"a": starts, "b": ends}) > 0.5
    assert (found != segments_clear(tree, starts, ends)).mean() < 1e-3
    # float32 in both: where they differ, a way passes an occupied voxel's edge within rounding.
    voxels, slack = tree.voxels(), 1e-4
    exact = starts.astype(float), ends.astype(float)
    few = slice(0, 1000)
    assert not (found[few] & meets_any_box(*(e[few] for e in exact), voxels + slack, voxels + 1.0 - slack)).any()
    assert not (~found[few] & ~meets_any_box(*(e[few] for e in exact), voxels - slack, voxels + 1.0 + slack)).any()
    assert 0.1 < found.mean() < 0.9


def test_octree_clear_looks_at_both_trees(device):
    rng = np.random.default_rng(6)
    starts, ends = segments(3000, rng)
    ball, plate = sphere(DEPTH, rings=10), box((3.0, 3.0, 20.0), (28.0, 28.0, 21.0))
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        trees = [builder.build(places, DEPTH, GrowingBuffer(context, "octree")) for places in (ball, plate)]
        joined = builder.join(trees, GrowingBuffer(context, "octree"))
        alone = [segments_clear(tree.read(), starts, ends) for tree in trees]
    bind(device, joined)
    found = ask(device, "float(octree_clear(a, b))", {"a": starts, "b": ends}) > 0.5
    assert (found != (alone[0] & alone[1])).mean() < 1e-3
    assert (alone[0] & ~alone[1]).any()
    assert (~alone[0] & alone[1]).any()


def test_values_that_are_not_finite_end(device, tree):
    bad = np.array([[np.nan, 1.0, 1.0], [np.inf, -np.inf, 1.0], [1e38, 1e38, -1e38], [0.0, 0.0, 0.0]], np.float32)
    starts, ends = np.repeat(bad, 4, axis=0), np.tile(bad, (4, 1))
    found, expected = clear_on_device(device, starts, ends), segments_clear(tree, starts, ends)
    finite = np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1)
    assert np.array_equal(found[finite], expected[finite])
    assert not expected[~finite].any()


def test_octree_reach(device, tree):
    normals = unit(500, np.random.default_rng(7))
    found = ask(device, "octree_reach(n)", {"n": normals})
    assert found == pytest.approx(reaches(normals), rel=1e-6)


def surface_pairs(count, rng):
    places = rng.uniform(0.0, SIZE, (count, 3)).astype(np.float32)
    others = (places + rng.normal(size=(count, 3)) * 2.0 ** rng.uniform(-3.0, 4.0, (count, 1))).astype(np.float32)
    return {"p": places, "n": unit(count, rng), "q": others, "m": unit(count, rng)}


def test_octree_lifted(device, tree):
    inputs = surface_pairs(4000, np.random.default_rng(8))
    found = ask(device, "octree_lifted(p, n, q, m)", inputs, 3)
    expected = lifted(*(values.astype(float) for values in inputs.values()))
    assert found == pytest.approx(expected, abs=1e-4)


def test_octree_lifted_by(device, tree):
    inputs = surface_pairs(4000, np.random.default_rng(14))
    found = ask(device, "octree_lifted_by(0.25, p, n, 0.5, q, m)", inputs, 3)
    own, other = np.full(4000, 0.25), np.full(4000, 0.5)
    assert found == pytest.approx(
        lifted_by(own, other, *(values.astype(float) for values in inputs.values())), abs=1e-4
    )


def test_octree_surfaces_see(device, tree):
    inputs = surface_pairs(4000, np.random.default_rng(9))
    found = ask(device, "float(octree_surfaces_see(p, n, q, m))", inputs) > 0.5
    expected = surfaces_see([tree], *inputs.values())
    assert (found != expected).mean() < 2e-3
    assert 0.1 < found.mean() < 0.9


def test_no_light_through_a_ball(device):
    """20,000 segments with ends at any distance from the surface but the reach of a voxel: no leak, and no shadow
    farther than the diagonal of a voxel from the ball."""
    leaks_and_false_shadows(device, depth=7, count=20_000)


@pytest.mark.full
@pytest.mark.parametrize("depth", [7, 8])
def test_no_light_through_a_ball_in_a_million(device, depth):
    leaks_and_false_shadows(device, depth, 1_000_000)


def leaks_and_false_shadows(device, depth, count):
    """A convex ball: crossings by cutting segments with its planes, distances between the spheres in and around it."""
    size = float(1 << depth)
    rng = np.random.default_rng(depth)
    ball = sphere(depth, rings=12)
    centre, outer = np.array([0.5, 0.47, 0.53]) * size, 0.42 * size
    normals = np.cross(ball[:, 1] - ball[:, 0], ball[:, 2] - ball[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inner = np.einsum("ij,ij->i", normals, ball[:, 0] - centre).min()
    bound = build(device, ball, depth)
    starts = rng.uniform(0.0, size, (count, 3)).astype(np.float32)
    ends = rng.uniform(0.0, size, (count, 3)).astype(np.float32)
    near = starts[::2] + rng.normal(size=starts[::2].shape) * 2.0 ** rng.uniform(0.0, depth - 2, (len(ends[::2]), 1))
    ends[::2] = np.clip(near, 0.0, size)
    found = clear_on_device(device, starts, ends)
    crossing = np.concatenate(
        [
            convex_crossing(starts[i : i + 20_000].astype(float), ends[i : i + 20_000].astype(float), ball)
            for i in range(0, count, 20_000)
        ]
    )
    assert crossing.sum() > 0.15 * count
    leaks = int((found & crossing).sum())
    assert leaks == 0
    # The walk's own rounding and that of the voxels.
    zone = np.sqrt(3.0) + 1e-3
    along = (ends - starts).astype(float)
    share = np.clip(-np.einsum("ij,ij->i", starts - centre, along) / (along**2).sum(axis=1), 0.0, 1.0)
    nearest = np.linalg.norm(starts + share[:, None] * along - centre, axis=1)
    farthest = np.maximum(np.linalg.norm(starts - centre, axis=1), np.linalg.norm(ends - centre, axis=1))
    away = (nearest > outer + zone) | (farthest < inner - zone)
    assert away.sum() > 0.1 * count
    assert int((~found & away).sum()) == 0
    del bound
