# SPDX-License-Identifier: GPL-3.0-or-later
"""Octrees of the sample scenes against the float64 oracle, and rays against Blender's own bounding volume hierarchy."""

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")
from mathutils import Vector  # noqa: E402
from mathutils.bvhtree import BVHTree  # noqa: E402

from tests.render.octree_rays import ask_exact, build, build_exact, clear_on_device  # noqa: E402
from tests.voxel_scenes import surface_points, torus  # noqa: E402
from vlm_addon.blender.extraction.extract import extract_scene  # noqa: E402
from vlm_addon.core.brick_triangles import ALL_EXACT, LIFT_SHARE, build_exact_octree  # noqa: E402
from vlm_addon.core.voxel_frame import make_voxel_frame  # noqa: E402
from vlm_addon.core.voxel_octree import codes_of, voxel_codes  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.growing_buffer import GrowingBuffer  # noqa: E402
from vlm_addon.render.kept import Kept  # noqa: E402
from vlm_addon.render.passes.voxelize import VoxelizePass  # noqa: E402
from vlm_addon.render.scene_octree import scene_octree  # noqa: E402

FOLDER = Path(__file__).resolve().parents[2] / "sample_blends"
SPOT = FOLDER.parents[1] / "shared" / "models" / "spot.obj"
BORDER = 1e-3


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


def opened(name, frame=None):
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{name}.blend"))
    if frame is not None:
        bpy.context.scene.frame_set(frame)
    return extract_scene()


def places_of(meshes, frame):
    return np.concatenate([frame.voxels(mesh.positions)[mesh.triangles] for mesh in meshes])


def require_between(codes, places, depth):
    """All voxels of the oracle, and none but those of the oracle with voxels that are larger by BORDER."""
    assert np.isin(voxel_codes(places, depth), codes).all()
    assert np.isin(codes, voxel_codes(places, depth, BORDER)).all()


def check_sample(device, name, resolution):
    snapshot = opened(name)
    frame = make_voxel_frame(snapshot.bounds(), resolution)
    places = places_of(snapshot.meshes, frame)
    with device.current() as context:
        builder = VoxelizePass(context, device.shaders)
        tree = builder.build(places, frame.depth, GrowingBuffer(context, "octree")).read()
    assert tree.voxel_count > 100
    require_between(codes_of(tree.voxels()), places, frame.depth)


@pytest.mark.parametrize(("name", "resolution"), [("cornell_box", 64), ("cornell_box", 128), ("monkey_box", 64)])
def test_voxels_of_a_sample_are_those_of_the_oracle(device, name, resolution):
    check_sample(device, name, resolution)


@pytest.mark.full
@pytest.mark.parametrize("resolution", [64, 128, 256])
@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.blend")))
def test_voxels_of_every_sample_are_those_of_the_oracle(device, name, resolution):
    check_sample(device, name, resolution)


def test_five_poses_of_the_dancer(device):
    """The dynamic tree follows the dancer; the room around is built once."""
    kept = Kept()
    moved = set()
    for pose in (1, 5, 13, 24, 40):
        snapshot = opened("dancer", pose)
        with device.current() as context:
            octree = scene_octree(context, device.shaders, kept, snapshot, 64)
            trees = [tree.read() for tree in octree.trees]
        for tree, dynamic in zip(trees, (False, True), strict=True):
            places = places_of([mesh for mesh in snapshot.meshes if mesh.dynamic == dynamic], octree.frame)
            require_between(codes_of(tree.voxels()), places, octree.frame.depth)
        moved.add(trees[1].bricks.tobytes())
    assert len(moved) == 5
    assert kept.built["static_octree"] == 1
    assert kept.built["dynamic_octree"] == 5


@pytest.mark.full
def test_two_hundred_frames_of_the_dancer(device):
    """The dance three times and a third: five frames are the oracle's, voxels and triangles, from the second round on
    every buffer is large enough, and the room around is built once."""
    kept, taken = Kept(), []
    opened("dancer", 1)
    checked = 0
    for frame in range(200):
        bpy.context.scene.frame_set(1 + frame % 60)
        snapshot = extract_scene()
        with device.current() as context:
            octree = scene_octree(context, device.shaders, kept, snapshot, 128)
            taken.append(octree.device_bytes)
            if frame % 45 == 10:
                moving = places_of([mesh for mesh in snapshot.meshes if mesh.dynamic], octree.frame)
                codes = codes_of(octree.trees[1].read().voxels())
                require_between(codes, moving, octree.frame.depth)
                starts, triangles, _ = octree.lists[1].read()
                exact = build_exact_octree(moving, octree.frame.depth)
                listed = codes.repeat(np.diff(starts.astype(int))) * len(moving) + triangles
                expected = exact.codes.repeat(np.diff(exact.starts)) * len(moving) + exact.triangles
                assert np.isin(expected, listed).all()
                checked += 1
    assert checked == 5
    assert kept.built["static_octree"] == 1
    assert kept.built["dynamic_octree"] == 200
    assert len(set(taken[60:])) == 1
    assert taken[-1] <= 2 * taken[0]


def spot(depth):
    """A closed cow of (t, 3, 3) triangles in voxel coordinates."""
    if not SPOT.exists():
        pytest.skip("the model spot.obj is not beside the checkout")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=str(SPOT))
    mesh = bpy.data.objects[0].data
    mesh.calc_loop_triangles()
    points = np.array([vertex.co for vertex in mesh.vertices], np.float64)
    corners = points[np.array([triangle.vertices for triangle in mesh.loop_triangles])]
    low, high = points.min(axis=0), points.max(axis=0)
    return (corners - 0.5 * (low + high)) * (0.8 * (1 << depth) / (high - low).max()) + 0.5 * (1 << depth)


def check_rays(device, places, depth, count):
    """No segment that meets a triangle is clear; none is blocked that stays farther from all than a voxel is across."""
    rng = np.random.default_rng(depth)
    size = float(1 << depth)
    # What Blender casts at is in float32, as the segments are.
    exact = places.astype(np.float32).astype(float)
    tree = blender_tree(exact)
    bound = build(device, exact, depth)
    starts = rng.uniform(0.0, size, (count, 3)).astype(np.float32)
    ends = starts + rng.normal(size=(count, 3)) * size * 2.0 ** rng.uniform(-4.0, 0.0, (count, 1))
    ends = np.clip(ends, 0.0, size).astype(np.float32)
    clear = clear_on_device(device, starts, ends)
    hits = np.array([is_hit(tree, a, b) for a, b in zip(starts.tolist(), ends.tolist(), strict=True)])
    assert hits.mean() > 0.05
    assert int((clear & hits).sum()) == 0
    blocked = np.flatnonzero(~clear & ~hits)
    assert len(blocked) > 0.001 * count
    zone = np.sqrt(3.0) + BORDER
    false_shadows = [row for row in blocked if not comes_near(tree, starts[row], ends[row], zone)]
    assert false_shadows == []
    del bound


def is_hit(tree, start, end):
    way = Vector(end) - Vector(start)
    return way.length > 0.0 and tree.ray_cast(Vector(start), way, way.length)[0] is not None


def comes_near(tree, start, end, zone):
    """Whether a segment has a point within `zone` of the surface: tried at finer and finer steps."""
    start, way = start.astype(float), (end - start).astype(float)
    for steps in (9, 65, 513, 4097):
        for share in np.linspace(0.0, 1.0, steps):
            if tree.find_nearest(Vector(start + share * way), zone)[0] is not None:
                return True
    return False


def blender_tree(places):
    return BVHTree.FromPolygons(places.reshape(-1, 3).tolist(), np.arange(3 * len(places)).reshape(-1, 3).tolist())


def facing_pairs(places, count):
    """Surface points that face each other: place, normal, place and normal in float32."""
    rng = np.random.default_rng(1)
    (p, n), (q, m) = surface_points(places, count, rng), surface_points(places, count, rng)
    faces = (((q - p) * n).sum(axis=1) > 1e-3) & (((q - p) * m).sum(axis=1) < -1e-3)
    return [values[faces].astype(np.float32) for values in (p, n, q, m)]


def check_exact(device, places, depth, count):
    """Pairs of surface points, and first hits along random ways from one of them: as Blender's own rays say, but where
    those graze the surface that they begin on, which for float32 is a matter of where they are begun."""
    tree, lift = blender_tree(places), LIFT_SHARE * (1 << depth)
    kept = build_exact(device, [places], depth)
    p, n, q, m = facing_pairs(places, count)
    seen = (
        ask_exact(device, f"float(octree_points_see(p, n, q, m, {ALL_EXACT}))", {"p": p, "n": n, "q": q, "m": m}) > 0.5
    )
    starts, ends = p.astype(float) + lift * n, q.astype(float) + lift * m
    hits = np.array([is_hit(tree, a, b) for a, b in zip(starts, ends, strict=True)])
    assert (seen == hits).mean() <= 1e-3
    assert 0 < seen.sum() < len(seen)
    way = np.random.default_rng(2).normal(size=p.shape)
    way *= (np.sign((way * n).sum(axis=1)) / np.linalg.norm(way, axis=1))[:, None]
    inputs = {"p": p, "n": n, "d": way.astype(np.float32)}
    found = ask_exact(device, "octree_first_hit(p, n, d).distance * float(octree_first_hit(p, n, d).found)", inputs)
    lengths = [
        tree.ray_cast(Vector(a), Vector(d))[3] or 0.0 for a, d in zip(starts, inputs["d"].astype(float), strict=True)
    ]
    assert (np.abs(found - lengths) > 0.01).mean() <= 1e-3
    assert np.count_nonzero(lengths) > 0.01 * len(lengths)
    del kept


def test_exact_ways_in_a_torus_are_blenders(device):
    check_exact(device, torus(7), 7, 60_000)


@pytest.mark.parametrize("name", ["cornell_box", "monkey_box"])
def test_exact_ways_in_a_sample_are_blenders(device, name):
    snapshot = opened(name)
    frame = make_voxel_frame(snapshot.bounds(), 64)
    check_exact(device, places_of(snapshot.meshes, frame), frame.depth, 20_000)


def test_rays_around_a_torus(device):
    check_rays(device, torus(7), 7, 20_000)


@pytest.mark.full
@pytest.mark.parametrize("depth", [7, 8])
@pytest.mark.parametrize("shape", [torus, spot])
def test_a_million_rays_around_closed_surfaces(device, shape, depth):
    check_rays(device, shape(depth), depth, 1_000_000)
