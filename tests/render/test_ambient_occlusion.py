# SPDX-License-Identifier: GPL-3.0-or-later
"""Openness from one view and from several against closed forms and rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.open_corner import open_beside_wall
from tests.render.closed_rooms import inward_box
from tests.render.open_pictures import RESOLUTION, SIZE, by_rays, look, mean_error
from tests.render.rooms import camera_at, quad
from vlm_addon.core.scene import (
    AREA,
    ORTHOGRAPHIC,
    POINT,
    SPOT,
    SUN,
    Camera,
    Light,
    Material,
    Mesh,
    SceneSnapshot,
)
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.ambient_occlusion import (
    JOINED,
    POINTS_IN_RUN,
    WEIGHTED,
    AmbientOcclusionPass,
    OcclusionSettings,
)
from vlm_addon.render.passes.gbuffer import GBuffer, GBufferPass
from vlm_addon.render.passes.rsm import LampReflections
from vlm_addon.render.view import make_view

GREY = (Material("grey"),)
FLOOR = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), name="floor")
WALL = quad((-2, 1, 0), (4, 0, 0), (0, 0, 2), name="wall")
"""Faces -y."""
BACK = quad((-2, 1.0001, 2), (4, 0, 0), (0, 0, -2), name="back of the wall")
BEHIND_WALL = Light("lamp", POINT, (10.0, 10.0, 10.0), (0.0, 1.6, 0.5))
TOWARDS_BOTH = camera_at((0.3, -1.9, 1.6), (0.0, 0.6, 0.1), lens=40.0)
"""On the floor in front of the wall, at the foot of which both meet."""
FLOOR_ONLY = camera_at((0.0, -0.5, 3.0), (0.0, 0.5, 0.0), lens=90.0)


def scene(meshes: Sequence[Mesh], camera: Camera, lights: Sequence[Light] = ()) -> SceneSnapshot:
    return SceneSnapshot("scene", tuple(meshes), GREY, lights=tuple(lights), camera=camera)


@pytest.mark.parametrize("kind", ["PERSPECTIVE", ORTHOGRAPHIC])
def test_beside_a_wall_both_surfaces_have_the_closed_form(device: Device, kind: str) -> None:
    camera = TOWARDS_BOTH if kind != ORTHOGRAPHIC else replace(TOWARDS_BOTH, kind=kind, ortho_scale=2.0)
    seen = look(device, scene([FLOOR, WALL], camera), 0.8, blur=False, steps=32, directions=16)
    for axis, value, distance in ((2, 0.0, 1.0 - seen.positions[..., 1]), (1, 1.0, seen.positions[..., 2])):
        # Next to the edge of the picture a view does not show what is in the way.
        where = seen.on(axis, value) & (np.abs(seen.positions[..., 0]) < 0.3)
        assert where.sum() > 100
        truth = open_beside_wall(distance / 0.8)
        assert np.ptp(truth[where]) > 0.3
        assert mean_error(seen.open, truth, where) < 0.02


def test_a_plane_hides_nothing_of_itself_however_it_is_seen(device: Device) -> None:
    grazing = camera_at((0.0, -1.9, 0.02), (0.0, 1.0, 0.0), clip_start=0.001)
    for camera in (grazing, FLOOR_ONLY):
        seen = look(device, scene([FLOOR], camera), 1.0, pictures=4)
        assert (seen.normals != 0.0).any()
        assert (seen.open == 1.0).all()


def test_a_round_thing_alone_is_open_but_for_its_facets(device: Device) -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 25)
    corners = 0.5 * np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
    sides = [quad(a, b - a, (0, 0, 1.0)) for a, b in pairwise(corners)]
    camera = camera_at((0.0, -3.0, 0.9), (0.0, 0.0, 0.5), lens=70.0)
    seen = look(device, scene(sides, camera), 0.3, pictures=4)
    shown = np.any(seen.normals != 0.0, axis=2)
    assert shown.sum() > 300
    assert seen.open[shown].mean() > 0.995
    assert (seen.open[~shown] == 1.0).all()


def test_what_floats_far_before_a_surface_does_not_darken_it(device: Device) -> None:
    card = quad((-0.3, -1.0, 0.5), (0.6, 0, 0), (0, 0, 0.6))
    camera = camera_at((0.0, -4.0, 0.8), (0.0, 1.0, 0.8), lens=50.0)
    seen = look(device, scene([WALL, card], camera), 0.4, pictures=4)
    wall = seen.on(1, 1.0)
    assert wall.sum() > 200
    assert seen.on(1, -1.0).any()
    assert (seen.open[wall] == 1.0).all()


def test_the_blur_stays_on_its_side_of_an_edge(device: Device) -> None:
    """The dark foot of a low step and the bright front of what steps forth are next to each other in the picture."""
    front = quad((-2, 0.93, 0), (1.9, 0, 0), (0, 0, 2))
    side = quad((-0.1, 0.93, 0), (0, 0.07, 0), (0, 0, 2))
    camera = camera_at((0.5, -3.0, 1.0), (-0.1, 0.95, 1.0), lens=140.0)
    seen = look(device, scene([WALL, front, side], camera), 0.3)
    bright, dark = seen.on(1, 0.93), seen.on(1, 1.0) & (seen.positions[..., 0] < 0.0)
    assert min(bright.sum(), dark.sum()) > 40
    # A pixel of the edge itself may show the block's side only, whose plane goes on.
    assert seen.open[bright].min() > 0.98
    assert seen.open[dark].min() < 0.75


def test_the_blur_takes_noise_and_not_the_mean(device: Device) -> None:
    snapshot = scene([FLOOR, WALL], TOWARDS_BOTH)
    truth = look(device, snapshot, 0.8, pictures=64, blur=False).open
    raw, blurred = (look(device, snapshot, 0.8, pictures=1, blur=blur).open for blur in (False, True))
    shown = truth < 1.0
    assert mean_error(blurred, truth, shown) < 0.5 * mean_error(raw, truth, shown)
    assert abs((blurred - truth)[shown].mean()) < 0.01


POWER = (10.0, 10.0, 10.0)
ABOVE = (0.0, -1.0, 1.6)
TOWARDS_FOOT = {"x_axis": (1.0, 0.0, 0.0), "y_axis": (0.0, 0.6, 0.8), "z_axis": (0.0, -0.8, 0.6)}
LAMPS = {
    "point": Light("lamp", POINT, POWER, (0.1, -0.6, 0.9)),
    "spot": Light("lamp", SPOT, POWER, ABOVE, **TOWARDS_FOOT, spot_angle=2.6),
    "sun": Light("lamp", SUN, POWER, ABOVE, **TOWARDS_FOOT),
    "area": Light("lamp", AREA, POWER, ABOVE, **TOWARDS_FOOT, size_x=0.3, size_y=0.3),
}


@pytest.mark.parametrize("name", LAMPS)
def test_lamps_show_the_wall_that_the_camera_does_not(device: Device, name: str) -> None:
    """The camera looks at the floor next to a wall that is seen edge on."""
    camera = camera_at((0.0, 0.5, 4.0), (0.0, 0.5, 0.0), lens=110.0)
    snapshot = scene([FLOOR, WALL], camera, [LAMPS[name]])
    alone = look(device, snapshot, 0.8)
    truth = open_beside_wall(np.abs(1.0 - alone.positions[..., 1]) / 0.8)
    where = alone.on(2, 0.0) & (alone.positions[..., 1] < 1.0)
    assert where.sum() > 500
    assert mean_error(alone.open, truth, where) > 0.05
    joined, weighted = (look(device, snapshot, 0.8, with_maps=True, combine=how) for how in (JOINED, WEIGHTED))
    assert mean_error(joined.open, truth, where) < 0.025
    assert mean_error(weighted.open, truth, where) < 0.8 * mean_error(alone.open, truth, where)


def test_a_lamp_that_sees_under_a_shelf_knows_that_it_is_thin(device: Device) -> None:
    """One view takes a shelf for as thick as the setting says, two know better."""
    shelf = inward_box((-0.5, -0.5, 0.28), (0.5, 0.5, 0.3), [0] * 6, outward=True)
    lamp = Light("lamp", POINT, POWER, (1.6, -0.2, 0.12))
    camera = camera_at((-1.0, -1.6, 1.6), (0.3, 0.1, 0.1), lens=40.0)
    behind = quad((-2, -2, 0), (0, 4, 0), (0, 0, 2))
    snapshot = scene([FLOOR, behind, *shelf], camera, [lamp])
    values = {"radius_m": 0.6, "thickness": 1.0}
    alone = look(device, snapshot, **values)
    truth = by_rays(alone, snapshot)
    floor = alone.on(2, 0.0)
    joined = look(device, snapshot, with_maps=True, **values)
    assert mean_error(joined.open, truth, floor) < 0.5 * mean_error(alone.open, truth, floor)


def test_a_view_that_does_not_see_a_point_has_no_weight(device: Device) -> None:
    snapshot = scene([FLOOR, WALL, BACK], TOWARDS_BOTH, [BEHIND_WALL])
    alone = look(device, snapshot, 0.5, pictures=2)
    weighted = look(device, snapshot, 0.5, pictures=2, with_maps=True, combine=WEIGHTED)
    # A texel of the map at the foot of the wall shows the floor behind it.
    away = (alone.positions[..., 1] < 0.8) & (alone.positions[..., 1] > 0.0)
    assert away.sum() > 500
    np.testing.assert_array_equal(weighted.open[away], alone.open[away])


def test_a_receiver_close_behind_a_wall_is_not_taken_to_be_inside_of_it(device: Device) -> None:
    """The camera sees too little around the receivers to know better than a lamp that the wall hides from them."""
    camera = camera_at((0.0, 0.85, 3.0), (0.0, 0.85, 0.0), lens=500.0)
    snapshot = scene([FLOOR, WALL, BACK], camera, [BEHIND_WALL])
    alone, joined = (look(device, snapshot, 0.5, with_maps=with_maps) for with_maps in (False, True))
    truth = open_beside_wall((1.0 - alone.positions[..., 1]) / 0.5)
    everywhere = np.ones(truth.shape, bool)
    assert mean_error(joined.open, truth, everywhere) < mean_error(alone.open, truth, everywhere) + 0.02


@pytest.mark.parametrize("steps", [2, 8])
def test_few_points_reach_as_far_as_many(device: Device, steps: int) -> None:
    """The last point of each direction is at the radius."""
    snapshot = scene([FLOOR, WALL], TOWARDS_BOTH)
    few, many = (look(device, snapshot, 0.8, blur=False, steps=count, thickness=2.0) for count in (steps, 64))
    floor = few.on(2, 0.0) & (np.abs(few.positions[..., 0]) < 0.3)
    assert abs((few.open - many.open)[floor].mean()) < 0.02


def test_a_lamp_behind_a_thin_wall_does_not_open_it(device: Device) -> None:
    """It sees that nothing is behind the wall, but to get there one goes through what the camera shows."""
    snapshot = scene([FLOOR, WALL, BACK], TOWARDS_BOTH, [BEHIND_WALL])
    alone, joined = (look(device, snapshot, 0.5, with_maps=with_maps) for with_maps in (False, True))
    floor = alone.on(2, 0.0) & (alone.positions[..., 1] < 0.95) & (np.abs(alone.positions[..., 0]) < 0.3)
    truth = open_beside_wall((1.0 - alone.positions[..., 1]) / 0.5)
    assert floor.sum() > 200
    assert mean_error(joined.open, truth, floor) < 0.02
    assert mean_error(joined.open, alone.open, floor) < 0.005


def test_kernels_of_any_size_join_all_their_points(device: Device) -> None:
    """A lamp that sees nothing changes nothing, however many textures the points take."""
    blind = Light("lamp", SPOT, POWER, (0.0, 0.0, 3.0), z_axis=(0.0, 0.0, -1.0), spot_angle=0.2)
    snapshot = scene([FLOOR, WALL], TOWARDS_BOTH, [blind])
    for directions, steps in ((1, 1), (5, 7), (8, 8), (3, POINTS_IN_RUN), (33, 5)):
        values = {"pictures": 1, "directions": directions, "steps": steps, "blur": False}
        alone = look(device, snapshot, 0.8, **values)  # type: ignore[arg-type]
        joined = look(device, snapshot, 0.8, with_maps=True, **values)  # type: ignore[arg-type]
        np.testing.assert_allclose(joined.open, alone.open, atol=1e-6)
        assert alone.open.min() < 1.0


def test_a_room_with_a_block_is_near_what_rays_say_and_nearer_with_its_lamp(device: Device) -> None:
    block = inward_box((-0.5, -0.1, 0.0), (0.1, 0.5, 0.6), [0] * 6, outward=True)
    room = inward_box((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5), [0] * 6)
    lamp = Light("lamp", POINT, POWER, (0.6, 0.5, 1.2))
    snapshot = scene([*room, *block], camera_at((0.7, -0.9, 1.2), (-0.2, 0.3, 0.3), lens=24.0), [lamp])
    alone = look(device, snapshot, 0.5)
    truth = by_rays(alone, snapshot)
    everywhere = np.ones(truth.shape, bool)
    error = mean_error(alone.open, truth, everywhere)
    assert truth.std() > 0.1
    assert error < 0.08
    assert mean_error(look(device, snapshot, 0.5, with_maps=True).open, truth, everywhere) < 0.5 * error


def test_without_a_radius_or_a_surface_all_is_open(device: Device) -> None:
    assert (look(device, scene([FLOOR, WALL], TOWARDS_BOTH), 0.0, pictures=1).open == 1.0).all()
    away = camera_at((0.0, 0.0, 5.0), (0.0, 0.0, 9.0))
    assert (look(device, scene([FLOOR, WALL], away), 0.5, pictures=1).open == 1.0).all()


def test_the_same_picture_twice_has_the_same_bits_and_the_next_has_others(device: Device) -> None:
    snapshot = scene([FLOOR, WALL], TOWARDS_BOTH, [LAMPS["point"]])
    first, again, both = (look(device, snapshot, 0.5, pictures, with_maps=True).open for pictures in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert (2.0 * both - first != first).any()


def test_the_size_of_the_scene_and_its_place_do_not_matter(device: Device) -> None:
    near = look(device, scene([FLOOR, WALL], TOWARDS_BOTH, [LAMPS["point"]]), 0.5, with_maps=True).open
    offset, size = np.array([4096.0, -2048.0, 1024.0]), 64.0
    lamp = replace(LAMPS["point"], position=tuple((offset + size * np.array(LAMPS["point"].position)).tolist()))
    matrix = TOWARDS_BOTH.matrix_world.copy()
    matrix[:3, 3] = offset + size * matrix[:3, 3]
    camera = replace(TOWARDS_BOTH, matrix_world=matrix, clip_start=size * 0.1, clip_end=size * 100.0)
    meshes = [replace(mesh, positions=offset + size * mesh.positions) for mesh in (FLOOR, WALL)]
    far = look(device, scene(meshes, camera, [lamp]), size * 0.5, with_maps=True).open
    # A point that is next to a surface may fall on its other side.
    assert np.abs(far - near).mean() < 1e-3


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf, 1e38])
@pytest.mark.parametrize("field", ["position", "shading_normal", "geometric_normal"])
def test_a_broken_pixel_breaks_nothing(device: Device, field: str, broken: float) -> None:
    snapshot = scene([FLOOR, WALL], TOWARDS_BOTH, [LAMPS["point"]])
    space = make_local_space(snapshot)
    with device.current() as context:
        local = space.scene(snapshot)
        assert local.camera is not None
        geometry = GpuGeometry(context, local, np.zeros(3))
        view = make_view(local.camera, *SIZE, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, *SIZE).render(geometry, view, 0)
        values = np.frombuffer(getattr(gbuffer, field).read(), np.float32).reshape(*SIZE[::-1], 4).copy()
        values[20, 28] = broken
        values[11, 13, :2] = broken
        texture = context.texture(SIZE, 4, values.tobytes(), dtype="f4")
        torn: GBuffer = replace(gbuffer, **{field: texture})
        maps = LampReflections(context, device.shaders, Kept(), snapshot, RESOLUTION, 1)
        for how in (JOINED, WEIGHTED):
            chosen = AmbientOcclusionPass(context, device.shaders, *SIZE, OcclusionSettings(combine=how))
            for views in ((), maps.maps()):
                found = read_image(chosen.render(torn, view, 0, views, space))
                assert np.isfinite(found).all()
                assert found.min() >= 0.0
                assert found.max() <= 1.0
