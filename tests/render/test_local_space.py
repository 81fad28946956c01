# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer's own space: what it keeps, and where its float32 has its digits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, lights_from_triangles, quad
from vlm_addon.core import lamps
from vlm_addon.core.scene import AREA, POINT, SPOT, SUN, Light, SceneSnapshot
from vlm_addon.render.local_space import GRAIN, HALF_DIAGONAL, is_fine_enough, make_local_space, make_still_space

LIGHTS = {
    POINT: Light("lamp", POINT, (5.0, 6.0, 7.0), (1.0, 2.0, 3.0), radius=0.3),
    SPOT: Light("lamp", SPOT, (5.0, 6.0, 7.0), (1.0, 2.0, 3.0), radius=0.3, spot_scale=(0.5, 2.0)),
    AREA: Light("lamp", AREA, (5.0, 6.0, 7.0), (1.0, 2.0, 3.0), size_x=0.5, size_y=2.0),
    SUN: Light("lamp", SUN, (5.0, 6.0, 7.0), (1.0, 2.0, 3.0), angle=0.1),
}
POINT_MESH = replace(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), positions=np.full((4, 3), 2.0))


def eye_at(snapshot: SceneSnapshot, position: tuple[float, float, float]) -> SceneSnapshot:
    assert snapshot.camera is not None
    matrix = snapshot.camera.matrix_world.copy()
    matrix[:3, 3] = position
    return replace(snapshot, camera=replace(snapshot.camera, matrix_world=matrix))


@pytest.mark.parametrize("kind", LIGHTS)
def test_lamps_bring_the_same_irradiance(kind: str) -> None:
    light = LIGHTS[kind]
    room = replace(box_room(), lights=(light,))
    space = make_local_space(room)
    points = np.random.default_rng(0).uniform(0.0, 2.0, (100, 3))
    normals = np.tile((0.36, 0.48, 0.8), (100, 1))
    local = lamps.lamp_irradiance(space.scene(room).lights[0], (points - space.origin) / space.unit, normals)
    np.testing.assert_allclose(local, lamps.lamp_irradiance(light, points, normals), rtol=1e-12)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_every_scene_is_of_one_size(scale: float) -> None:
    room = box_room()
    scaled = replace(room, meshes=tuple(replace(m, positions=scale * m.positions) for m in room.meshes))
    low, high = make_local_space(scaled).scene(scaled).bounds()
    assert np.linalg.norm(high - low) == pytest.approx(2 * HALF_DIAGONAL)


def test_the_camera_looks_at_the_same_things() -> None:
    room = box_room((100.0, -50.0, 7.0))
    local = make_local_space(room).scene(room)
    views = []
    for scene in (room, local):
        assert scene.camera is not None
        from_camera = np.linalg.inv(scene.camera.matrix_world)
        points = np.concatenate([mesh.positions for mesh in scene.meshes])
        views.append(points @ from_camera[:3, :3].T + from_camera[:3, 3])
    np.testing.assert_allclose(views[1][:, :2] / views[1][:, 2:], views[0][:, :2] / views[0][:, 2:], rtol=1e-12)
    assert room.camera is not None
    assert local.camera is not None
    clips = [camera.clip_start / -view[0, 2] for camera, view in zip((room.camera, local.camera), views, strict=True)]
    assert clips[1] == pytest.approx(clips[0])


def test_light_mesh_moves_with_the_scene() -> None:
    room = box_room()
    corners = np.random.default_rng(1).uniform(0.0, 2.0, (5, 3, 3))
    space = make_local_space(room)
    local = space.light_mesh(lights_from_triangles(corners))
    np.testing.assert_allclose(space.world_points(local.corners.astype(np.float32)), corners, atol=1e-6)
    np.testing.assert_allclose(space.world_points(local.samples.positions.astype(np.float32)), corners.mean(axis=1))
    np.testing.assert_allclose(local.areas * space.unit**2, lights_from_triangles(corners).areas)


def test_digits_are_spent_where_the_camera_is() -> None:
    """A camera amid a kilometre of floor: a micrometre before it is told apart."""
    floor = quad((-512, -512, 0), (1024, 0, 0), (0, 1024, 0))
    eye = (300.0, -200.0, 0.02)
    scene = eye_at(replace(box_room(), meshes=(floor,)), eye)
    space = make_local_space(scene)
    before = (np.array([np.add(eye, (0.1, 0.0, 0.0)), np.add(eye, (0.100001, 0.0, 0.0))]) - space.origin) / space.unit
    rounded = before.astype(np.float32).astype(float)
    assert np.diff(rounded[:, 0])[0] * space.unit == pytest.approx(1e-6, rel=0.05)


def test_a_small_move_of_the_camera_rounds_nothing_anew() -> None:
    room = box_room()
    one, other = (make_local_space(eye_at(room, (0.9, 0.8 + move, 1.1))) for move in (0.0, 1e-6))
    assert (one.origin == other.origin).all()


def test_origin_stays_in_the_scene_when_the_camera_is_far_away() -> None:
    room = box_room()
    low, high = room.bounds()
    space = make_local_space(eye_at(room, (1e6, 1.0, 1.0)))
    assert (np.abs(space.origin - np.clip((1e6, 1.0, 1.0), low, high)) <= GRAIN * space.unit).all()


@pytest.mark.parametrize("meshes", [(), (POINT_MESH,)], ids=["nothing", "one point"])
def test_a_scene_without_extent_is_in_metres(meshes: tuple) -> None:
    space = make_local_space(replace(box_room(), meshes=meshes))
    assert space.unit == 1.0
    assert np.isfinite(space.origin).all()


@pytest.mark.parametrize(
    ("size", "clip_start", "enough"),
    [(5.0, 0.1, True), (30.0, 0.1, True), (2000.0, 0.1, False), (2000.0, 5.0, True), (5.0, 1e-4, False)],
)
def test_a_space_that_no_camera_moves_has_digits_for_rooms(size: float, clip_start: float, enough: bool) -> None:
    low, high = np.zeros(3), np.full(3, size)
    still = make_still_space(low, high)
    camera = camera_at((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), clip_start=clip_start)
    assert is_fine_enough(still, camera) == enough
    # What it stands for: a step of float32 at the scene's far end, on a thing right before the camera.
    step = float(np.spacing(np.float32(still.local_points(high).max()))) * still.unit
    left, right, _, _ = camera.frame(1, 1)
    assert (step < 2e-3 * clip_start * (right - left)) or not enough
