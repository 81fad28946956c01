# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked visibility on the device: against rays between triangles, in pictures, and kept over frames."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from tests.core.visible_room import are_open, block_room, exact_shares, surface_lights
from tests.render.closed_rooms import inward_box
from tests.render.rooms import camera_at, quad, split
from vlm_addon.core.baked_visibility import FULL, UNFACED, BakedVisibility, make_baked, row_weights
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.light_mesh import VirtualLightMesh, empty_light_mesh
from vlm_addon.core.progress import silent
from vlm_addon.core.scene import DIFFUSE, POINT, Float32, Light, Material, SceneSnapshot
from vlm_addon.core.triangle_tree import build_tree
from vlm_addon.core.visibility_cells import make_cells
from vlm_addon.core.visibility_rows import VisibilityRows, make_rows, opaque_corners
from vlm_addon.core.voxel_frame import make_voxel_frame
from vlm_addon.render import scene_visibility
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.bake_visibility import BakeVisibilityPass
from vlm_addon.render.passes.baked_pixels import BakedPixelsPass, GpuBakedVisibility
from vlm_addon.render.passes.gbuffer import GBuffer
from vlm_addon.render.scene_octree import scene_octree
from vlm_addon.render.techniques import vlm
from vlm_addon.render.view import View

WHITE = (Material("white", DIFFUSE, (0.8, 0.8, 0.8)),)
CELLS = 4


def lit(room: SceneSnapshot, lamp: tuple[float, float, float] = (0.4, 0.5, 1.6)) -> SceneSnapshot:
    """With a lamp, seen from a corner."""
    return replace(
        room,
        lights=(Light("lamp", POINT, (40.0, 40.0, 40.0), lamp),),
        camera=camera_at((1.9, 0.1, 1.7), (0.8, 1.2, 0.6), lens=18.0),
    )


def settings(**values: object) -> RenderSettings:
    chosen = {"lights": "all", "visibility": "baked", "visibility_cells": CELLS, "visibility_points": 4, **values}
    return RenderSettings(
        48, 36, technique_settings=chosen, samples=1, shadow_resolution=128, shadow_samples=1, buffers=True
    )


def irradiance(frame: Frame) -> Float32:
    return frame.images["irradiance"]


@pytest.fixture(scope="module")
def lights() -> VirtualLightMesh:
    return surface_lights(block_room(), 1)


@pytest.fixture(scope="module")
def baked(device: Device, lights: VirtualLightMesh) -> tuple[VisibilityRows, np.ndarray, BakedVisibility]:
    """Of the block room, with triangles asked everywhere."""
    room = block_room()
    with device.current() as context:
        octree = scene_octree(context, device.shaders, device.kept, room, 8 * CELLS)
        render = BakeVisibilityPass(context, device.shaders, near_reach=0)
        air = make_cells(octree.trees[0].read().voxels(), octree.frame.resolution)
        rows = make_rows(room, octree.frame, air, 4, partial(render.are_open, octree=octree))
        shares = render.bake(rows, lights.samples, octree, silent)
        return rows, shares, make_baked(octree.frame, air, rows, shares, "exact")


def test_shares_are_those_of_rays_between_triangles(baked: tuple, lights: VirtualLightMesh) -> None:
    rows, shares, all_of_it = baked
    chosen = np.random.default_rng(0).integers(0, shares.shape, (4000, 2)).T
    expected = exact_shares(block_room(), all_of_it.frame, rows, lights, *chosen)
    found = shares[tuple(chosen)]
    known = expected != UNFACED
    assert ((found == UNFACED) == ~known).all()
    assert 0.02 < (expected[known] < FULL).mean() < 0.98
    assert (found == expected).all()


def test_points_that_are_shut_off_are_those_of_rays_between_triangles(device: Device) -> None:
    """Random places over and under a sheet that lies close above a floor."""
    room = SceneSnapshot("sheet", (quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), quad((0.5, 0.5, 0.05), (1, 0, 0), (0, 1, 0))))
    generator = np.random.default_rng(0)
    with device.current() as context:
        octree = scene_octree(context, device.shaders, device.kept, room, 32)
        places = octree.frame.voxels(generator.uniform(0.0, 2.0, (3000, 3)) * (1.0, 1.0, 0.0))
        normals = np.tile([0.0, 0.0, 1.0], (3000, 1))
        found = BakeVisibilityPass(context, device.shaders).are_open(places, normals, octree)
    expected = are_open(build_tree(opaque_corners(room, octree.frame)), places, normals)
    assert 0.1 < expected.mean() < 0.9
    assert (found == expected).all()


def test_rows_of_pixels_are_those_of_the_oracle(device: Device, baked: tuple) -> None:
    """Random points of floor and block: weights of each row, from the words that pixels keep."""
    all_of_it = baked[2]
    generator = np.random.default_rng(4)
    count = 64
    positions = generator.uniform(0.1, 1.9, (count, 3)) * (1.0, 1.0, 0.0)
    normals = np.tile([0.0, 0.0, 1.0], (count, 1))
    half = count // 2
    positions[half:] = generator.uniform((0.7, 0.75, 0.8), (1.3, 1.2, 0.8), (half, 3))
    image = np.zeros((8, 8, 4), np.float32)
    with device.current() as context:

        def upload(values: np.ndarray) -> object:
            image[..., :3] = values.reshape(8, 8, 3)
            return context.texture((8, 8), 4, image.tobytes(), dtype="f4")

        position, normal = upload(positions), upload(normals)
        gbuffer = GBuffer(position, normal, normal, position, position, position)  # type: ignore[arg-type]
        eye = View(
            np.eye(4), np.array([1.0, 1.0, 1.5]), np.array([0.0, 0.0, 1.0]), False, (0.1, 10.0), np.zeros((3, 3))
        )
        pixels = BakedPixelsPass(context, device.shaders, 8, 8)
        on_device = GpuBakedVisibility(context, all_of_it)
        pixels.render(gbuffer, eye, LocalSpace(np.zeros(3), 1.0), on_device)
        words = pixels.rows().reshape(count, -1)
        counted = np.frombuffer(on_device.counts.read(), np.uint32)
    expected = row_weights(all_of_it, all_of_it.frame.voxels(positions), normals)
    found = np.zeros_like(expected)
    for point in range(count):
        np.add.at(found[point], words[point] >> 12, words[point] & 4095)
    found /= found.sum(axis=1, keepdims=True)
    expected /= expected.sum(axis=1, keepdims=True)
    assert (counted == 0).all()
    assert np.abs(found - expected).max() <= 2e-3


def test_a_bake_can_be_cancelled(device: Device, baked: tuple, lights: VirtualLightMesh) -> None:
    with device.current() as context:
        octree = scene_octree(context, device.shaders, device.kept, block_room(), 8 * CELLS)
        with pytest.raises(Cancelled):
            BakeVisibilityPass(context, device.shaders).bake(baked[0], lights.samples, octree, lambda *_: False)


def test_no_lights_and_no_rows_give_no_shares(device: Device, baked: tuple, lights: VirtualLightMesh) -> None:
    with device.current() as context:
        octree = scene_octree(context, device.shaders, device.kept, block_room(), 8 * CELLS)
        render = BakeVisibilityPass(context, device.shaders)
        nothing = SceneSnapshot("nothing")
        none = make_rows(nothing, octree.frame, baked[2].cells, 4, partial(render.are_open, octree=octree))
        assert render.bake(none, lights.samples, octree, silent).shape == (0, len(lights))
        assert render.bake(baked[0], empty_light_mesh().samples, octree, silent).shape == (len(baked[0]), 0)


def test_without_anything_in_the_way_the_picture_is_the_same_to_the_bit(
    device: Device,
) -> None:
    """The room alone, baked though nothing need be."""
    room = lit(SceneSnapshot("room", tuple(inward_box((0, 0, 0), (2, 2, 2), [0] * 6)), WHITE))
    lights = surface_lights(room, 1)
    plain = device.render(room, lights, settings(visibility="none"))
    skipped = device.render(room, lights, settings())
    assert any("no visibility is baked" in reason for reason in skipped.reasons)
    assert "visibility_rows" not in skipped.counters
    found = device.render(room, lights, replace(settings(), effects={"light_visibility": "on"}))
    assert found.counters["visibility_pixels_without"] == 0
    assert (irradiance(found) == irradiance(plain)).all()
    shares = device.kept.get(scene_visibility.KIND, _kept_key(device), _unexpected).baked.shares
    assert np.isin(shares, (FULL, UNFACED)).all()


def _kept_key(device: Device) -> str:
    return device.kept._latest[scene_visibility.KIND][0]


def _unexpected() -> GpuBakedVisibility:
    raise AssertionError("it is kept")


def test_a_picture_is_nearer_to_many_rays_than_one_without_visibility(device: Device, lights: VirtualLightMesh) -> None:
    room = lit(block_room())
    rays = settings(visibility="octree", visibility_rays=16, octree_resolution=64, exact_reach=64, filter="none")
    truth = irradiance(device.render(room, lights, replace(rays, samples=8)))
    plain, found = (
        irradiance(device.render(room, lights, replace(settings(visibility=name), samples=8)))
        for name in ("none", "baked")
    )

    def error(picture: Float32) -> float:
        return float(np.sqrt(np.mean((picture - truth) ** 2)) / truth.mean())

    assert error(plain) > 0.1
    assert error(found) < 0.4 * error(plain)


def test_the_picture_of_visibility_is_what_the_light_is_multiplied_by(device: Device, lights: VirtualLightMesh) -> None:
    room = lit(block_room())
    found = device.render(room, lights, settings())
    plain = irradiance(device.render(room, lights, settings(visibility="none")))
    seen = found.images["vlm_visibility"]
    assert seen == pytest.approx(irradiance(found) / plain, rel=1e-5)
    assert 0.0 <= seen.min() < 0.5
    assert seen.max() <= 1.0


def test_all_lights_cells_and_clusters_agree(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vlm, "FEW_LIGHTS", 0)
    room, lights = lit(block_room()), surface_lights(block_room(), 2)
    whole = irradiance(device.render(room, lights, settings()))
    in_cells = irradiance(device.render(room, lights, settings(lights="range", range=1e3, grid=4)))
    assert np.allclose(in_cells, whole, rtol=1e-4, atol=1e-4 * whole.mean())
    clustered = device.render(room, lights, settings(lights="tolerance", tolerance=0.02))
    assert clustered.counters["lists_entries"] > 0
    # A cluster is seen as the mean of its lights, which may differ by as much again as the tolerance.
    off = np.abs(irradiance(clustered) - whole) / np.maximum(whole, 0.1 * whole.mean())
    assert np.quantile(off, 0.95) <= 0.04
    plain = irradiance(device.render(room, lights, settings(visibility="none")))
    assert np.abs(plain - whole).mean() > 0.05 * whole.mean()


def two_rooms(wall: float, slant: float) -> SceneSnapshot:
    """Two rooms, a wall without thickness at x = wall, turned by `slant`; a lamp in the first, seen in the second."""
    rooms = [*inward_box((0, 0, 0), (wall, 1.5, 1.2), [0] * 6), *inward_box((wall, 0, 0), (2.3, 1.5, 1.2), [0] * 6)]
    meshes = []
    for mesh in rooms:
        between = (mesh.positions[:, 0] > 0.1) & (mesh.positions[:, 0] < 2.2)
        positions = mesh.positions.copy()
        positions[:, 0] += np.where(between, slant * (positions[:, 1] - 0.75), 0.0)
        meshes.append(replace(mesh, positions=positions))
    lamp = Light("lamp", POINT, (20.0, 20.0, 20.0), (0.4, 0.7, 0.8))
    camera = camera_at((2.2, 0.2, 0.6), (wall + 0.05, 1.0, 0.4), lens=14.0)
    return SceneSnapshot("rooms", tuple(meshes), WHITE, lights=(lamp,), camera=camera)


@pytest.mark.parametrize(("wall", "slant"), [(1.0, 0.0), (1.13, 0.3)])
def test_a_closed_room_beside_a_lit_one_is_black(device: Device, wall: float, slant: float) -> None:
    dark = two_rooms(wall, slant)
    lights = surface_lights(dark, 1)
    # The lights stand a little behind their walls, which have no thickness: in the other room.
    normals = lights.area_vectors / lights.areas[:, None]
    lights = replace(lights, vertices=lights.vertices - 2e-3 * np.repeat(normals, 3, axis=0))
    bright = replace(dark, camera=camera_at((0.1, 0.2, 0.6), (wall, 1.0, 0.4), lens=14.0))
    chosen = settings(visibility_cells=8)
    found, lit_room = (irradiance(device.render(scene, lights, chosen)) for scene in (dark, bright))
    leaking = irradiance(device.render(dark, lights, settings(visibility="none")))
    assert leaking.max() > 0.1 * lit_room.mean() > 0.0
    assert found.max() <= 1e-3 * lit_room.mean()


@pytest.fixture
def own_device() -> Device:
    """A device that has kept nothing yet."""
    with Device() as opened:
        yield opened


def test_a_moved_lamp_bakes_nothing_and_a_moved_object_does(own_device: Device, lights: VirtualLightMesh) -> None:
    def built(room: SceneSnapshot) -> float:
        return own_device.render(room, lights, settings(visibility_points=1)).counters["baked_visibility_built"]

    room = lit(block_room())
    assert built(room) == 1
    assert built(room) == 0
    assert built(lit(block_room(), (1.5, 1.0, 1.2))) == 0
    assert built(replace(room, camera=camera_at((0.2, 0.2, 1.5), (1.0, 1.0, 0.5)))) == 0
    block = tuple(replace(mesh, positions=mesh.positions + np.array([0.1, 0.0, 0.0])) for mesh in room.meshes[6:])
    assert built(replace(room, meshes=(*room.meshes[:6], *block))) == 1


def test_cells_are_coarser_where_shares_would_take_too_much(
    own_device: Device, lights: VirtualLightMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = lit(block_room())
    monkeypatch.setattr(scene_visibility, "MOST_BYTES", 40_000)
    frame = own_device.render(room, lights, settings(visibility_cells=8, visibility_points=1))
    assert frame.counters["visibility_cells"] == 4
    assert any("4 cells along the longest axis in place of 8" in reason for reason in frame.reasons)
    monkeypatch.setattr(scene_visibility, "MOST_BYTES", 1_000)
    with pytest.raises(InvalidInput, match="MB are the limit"):
        own_device.render(room, lights, settings(visibility_cells=8, visibility_points=2))


def test_cells_too_coarse_for_a_dense_mesh_are_told(device):
    """The room in the middle of a floor of 400 m: all of it lies in a cell or two."""
    room = block_room()
    corners = split(np.concatenate([mesh.positions[mesh.triangles] for mesh in room.meshes]), 4)
    count = len(corners)
    dense = replace(
        room.meshes[0],
        positions=corners.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
    )
    far = quad((-200.0, -200.0, -50.0), (400.0, 0.0, 0.0), (0.0, 400.0, 0.0))
    wide = replace(room, meshes=(dense, far))
    baked = SimpleNamespace(frame=make_voxel_frame(wide.bounds(), 64))
    assert "cells of 50" in scene_visibility.dense_text(Kept(), wide, baked)
    near = SimpleNamespace(frame=make_voxel_frame(room.bounds(), 64))
    assert scene_visibility.dense_text(Kept(), room, near) == ""
