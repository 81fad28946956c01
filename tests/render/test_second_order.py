# SPDX-License-Identifier: GPL-3.0-or-later
"""Second-order illumination against closed forms of rooms, against sums in numpy, and in cases that end badly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import (
    ROOM_REFLECTANCES,
    ROOM_SIZE,
    empty_room,
    inward_box,
    room_area,
    wall_points,
)
from tests.render.gathering import COLUMNS, picture_of
from tests.render.rooms import box_room, camera_at, quad
from tests.render.test_rsm_gather import LAMPS, MIDDLE, reflected_power, wall_grid
from vlm_addon.core.lamps import LampSample, lamp_irradiance
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.progress import silent
from vlm_addon.core.scene import AREA, SPOT, Float64, Light, SceneSnapshot
from vlm_addon.core.surface_points import random_surface_points
from vlm_addon.core.vpl import VirtualPointLights, vpl_irradiance
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.indirect_lights import IndirectLights, light_records
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.point_lights import BoundPass, PointLightPass, uploaded
from vlm_addon.render.passes.rsm import LampReflections, map_points

WORLD = LocalSpace(np.zeros(3), 1.0)
NONE = VirtualPointLights(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
AREA_MAPS = 4
BRIGHT = np.full(3, 1e30)


def lit_by(
    device: Device,
    lights: VirtualPointLights,
    points: Float64,
    normals: Float64,
    negative: VirtualPointLights = NONE,
    brightest: Float64 = BRIGHT,
    gain: float = 1.0,
) -> Float64:
    """(p, 4): irradiance, and what negative lights take away."""
    with device.current() as context:
        gbuffer = picture_of(device, points, normals)
        summed, taken = (uploaded(context, light_records(part, WORLD, gain)) for part in (lights, negative))
        gather = PointLightPass(context, device.shaders, *gbuffer.size)
        found = gather.render(gbuffer, summed, taken, brightest, silent)
        return np.frombuffer(found.read(), np.float32).reshape(-1, 4).astype(float)


FORCED = {"indirect_light": "on"}
"""Effects of a frame whose technique runs although its plan would leave it out."""


def rendered(device: Device, scene: SceneSnapshot, pictures: int = 1, size: int = 32, **settings: object) -> Frame:
    wanted = RenderSettings(size, 3 * size // 4, "second_order", settings, pictures, 64, 4, buffers=True)
    return device.render(scene, None, wanted)


def forced(device: Device, scene: SceneSnapshot) -> Frame:
    wanted = RenderSettings(32, 24, "second_order", samples=1, shadow_resolution=64, buffers=True, effects=FORCED)
    return device.render(scene, None, wanted)


Placed = tuple[VirtualPointLights, Float64, float]
"""Lights in a room, what no irradiance exceeds, and by what they are multiplied for what the bound takes off."""


def placed(device: Device, room: SceneSnapshot, counts: Sequence[int]) -> list[Placed]:
    with device.current() as context:
        maps = LampReflections(context, device.shaders, Kept(), room, 128, AREA_MAPS)
        points = random_surface_points(room.meshes, 512)
        bound = BoundPass(context, device.shaders, points.positions, points.normals)
        found = []
        for count in counts:
            source = IndirectLights(context, device.shaders, maps)
            (lights,) = source.take(count)
            share = bound.share(uploaded(context, light_records(lights, WORLD)), float(source.brightest.mean()))
            found.append((lights, source.brightest, 1.0 / (1.0 - share)))
    return found


@pytest.mark.parametrize("name", LAMPS)
def test_mean_irradiance_of_the_walls_is_that_of_one_bounce(device: Device, name: str) -> None:
    """Within 5 %, whatever the number of lights: what the bound takes off is made up for."""
    points, normals, _ = wall_points(4096)
    for lights, brightest, gain in placed(device, empty_room([LAMPS[name]]), (100, 1000)):
        found = lit_by(device, lights, points, normals, brightest=brightest, gain=gain)[:, :3].mean(axis=0)
        np.testing.assert_allclose(found, reflected_power(LAMPS[name]) / room_area(), rtol=0.05)
        assert gain > 1.01


def test_sum_over_lights_is_that_of_the_oracle(device: Device) -> None:
    points, normals, _ = wall_points(256)
    ((lights, _, _),) = placed(device, empty_room([LAMPS["spot"]]), [77])
    found = lit_by(device, lights, points, normals)[:, :3]
    np.testing.assert_allclose(found, vpl_irradiance(points, normals, lights).irradiance, rtol=1e-4, atol=1e-6)


def test_negative_lights_are_taken_away_from_the_sum_and_noted(device: Device) -> None:
    points, normals, _ = wall_points(256)
    ((lights, _, _),) = placed(device, empty_room([LAMPS["spot"]]), [20])
    negative = replace(lights, flux=1.5 * lights.flux[::-1])
    kept, taken = (vpl_irradiance(points, normals, part).irradiance for part in (lights, negative))
    found = lit_by(device, lights, points, normals, negative)
    np.testing.assert_allclose(found[:, :3], kept - taken, rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(found[:, 3], taken.mean(axis=1), rtol=1e-4, atol=1e-6)
    assert found[:, :3].min() < 0.0


def corner_points() -> tuple[Float64, Float64]:
    """In corners, at edges and up to 1 cm off the walls, each with three normals."""
    half = 0.5 * np.array(ROOM_SIZE)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    points = np.concatenate([corners * (half - gap) for gap in (0.0, 1e-4, 1e-2)] * 3)[:COLUMNS]
    normals = np.concatenate([-np.sign(points[:, k : k + 1]) * np.eye(3)[k] for k in range(3)])
    return np.tile(points, (3, 1)), normals


def most_of_each_part(light: Light) -> Float64:
    """(3,) W/m²: the greatest radiosity that each part of a lamp with a map of its own makes, together."""
    sources, facing, _, walls = wall_grid(200 if light.kind != AREA else 40)
    reflectances = np.array(ROOM_REFLECTANCES)[walls]
    parts = [lamp_irradiance(light, sources, facing)]
    if light.kind == AREA:
        parts = [sample_irradiance(light, sample, sources, facing) for sample in map_points(light, AREA_MAPS)]
    return np.sum([(reflectances * part).max(axis=0) for part in parts], axis=0)


def sample_irradiance(light: Light, sample: LampSample, points: Float64, normals: Float64) -> Float64:
    """Of an area lamp's cell, in 36 pieces; `sample` says which cell."""
    low, high = sample.cell.min(axis=0), sample.cell.max(axis=0)
    places = low + (np.indices((6, 6)).reshape(2, -1).T + 0.5) / 6.0 * (high - low)
    origin = np.array(light.position) + places @ np.array([light.x_axis, light.y_axis])
    found = np.zeros((len(points), 3))
    for place in origin:
        towards = place - points
        squared = (towards**2).sum(axis=1)
        facing = np.maximum((towards * normals).sum(axis=1), 0.0) * np.maximum(-towards @ -np.array(light.z_axis), 0.0)
        found += (facing / (np.pi * squared**2))[:, None] * np.array(light.power) * sample.share / 36.0
    return found


@pytest.mark.parametrize("name", ["point near the ceiling", "spot", "area"])
def test_nothing_is_brighter_than_the_brightest_surface(device: Device, name: str) -> None:
    """For any number of lights; also at the lights themselves, on all six sides."""
    points, normals = corner_points()
    most = most_of_each_part(LAMPS[name])
    sides = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), COLUMNS, axis=0)
    for lights, brightest, gain in placed(device, empty_room([LAMPS[name]]), (1, 2, 7, 50, 400, 2000)):
        at_lights = np.resize(lights.positions, (6 * COLUMNS, 3))
        for place, normal in ((points, normals), (at_lights, sides), (at_lights + 1e-4 * sides, -sides)):
            found = lit_by(device, lights, place, normal, brightest=brightest, gain=gain)
            assert np.isfinite(found).all()
            assert (found[:, :3] <= 1.03 * most).all()
            assert (found >= 0.0).all()


@pytest.mark.parametrize("count", [1, 3, 100, 2000])
def test_no_pixel_of_a_picture_is_brighter_than_the_brightest_surface(device: Device, count: int) -> None:
    frame = rendered(device, box_room(), 1, 64, indirect_lights=count, negative_lights=0)
    sources = wall_samples(box_room())
    (lamp,) = box_room().lights
    most = 0.8 * lamp_irradiance(lamp, *sources).max()
    assert frame.images["irradiance"].max() <= 1.05 * most
    assert frame.images["irradiance"].max() > 0.0


def wall_samples(scene: SceneSnapshot) -> tuple[Float64, Float64]:
    found = random_surface_points(scene.meshes, 20_000)
    return found.positions, found.normals


def test_light_switched_off_and_ten_lamps_and_none(device: Device) -> None:
    lamps = [
        replace(MIDDLE, position=(0.3 * i - 1.5, 0.1 * i - 0.5, 0.05 * i), power=(i + 1.0,) * 3) for i in range(10)
    ]
    off = [replace(lamp, power=(0.0, 0.0, 0.0)) for lamp in lamps[1:]]
    together = rendered(device, empty_room(lamps), indirect_lights=500, resolution=64)
    assert together.counters["reflective_maps"] == 10
    assert together.counters["indirect_lights"] == 500
    points, normals, _ = wall_points(2048)
    ((lights, brightest, gain),) = placed(device, empty_room(lamps), [1000])
    found = lit_by(device, lights, points, normals, brightest=brightest, gain=gain)[:, :3].mean(axis=0)
    np.testing.assert_allclose(found, sum(map(reflected_power, lamps)) / room_area(), rtol=0.05)
    alone = rendered(device, empty_room([lamps[0]])).images["irradiance"]
    assert (rendered(device, empty_room([lamps[0], *off])).images["irradiance"] == alone).all()
    assert alone.any()
    for scene in (empty_room(off), empty_room([])):
        assert not rendered(device, scene).plan.runs("indirect_light")
        frame = forced(device, scene)
        assert not frame.images["irradiance"].any()
        assert frame.counters["indirect_lights"] == frame.counters["negative_lights"] == 0


def test_lights_are_kept_while_nothing_but_the_camera_moves(device: Device) -> None:
    room = empty_room([MIDDLE])
    rendered(device, room)
    built = device.kept.built["indirect_lights"]
    moved = rendered(device, replace(room, camera=camera_at((1.0, 0.5, 0.3), (-0.5, 0.0, 0.0), lens=20.0)))
    assert device.kept.built["indirect_lights"] == built
    assert moved.counters["reflective_maps_drawn"] == 0
    fresh = Device()
    with fresh:
        again = rendered(fresh, replace(room, camera=camera_at((1.0, 0.5, 0.3), (-0.5, 0.0, 0.0), lens=20.0)))
    assert (moved.images["irradiance"] == again.images["irradiance"]).all()
    rendered(device, empty_room([replace(MIDDLE, position=(0.1, 0.0, 0.0))]))
    assert device.kept.built["indirect_lights"] == built + 1


def test_light_of_the_world_bounces_as_in_the_gather_from_maps(device: Device) -> None:
    scene = replace(box_room(), lights=(), world_radiance=(1.0, 0.9, 0.8))
    means = []
    for technique, values in (("second_order", {"negative_lights": 0}), ("rsm_gather", {"samples": 300})):
        settings = RenderSettings(32, 24, technique, {**values, "resolution": 64}, 4, 64, 4, world_lights=8)
        means.append(device.render(scene, None, settings).images["indirect"].mean(axis=(0, 1)))
    assert means[0].min() > 0.01
    np.testing.assert_allclose(means[0], means[1], rtol=0.1)


def test_light_count_0_leaves_direct_light_alone(device: Device) -> None:
    frame = rendered(device, box_room(), indirect_lights=0)
    assert not frame.images["indirect"].any()
    assert frame.images["direct"].any()


def test_lamp_inside_a_wall_lights_nothing(device: Device) -> None:
    room = empty_room([replace(MIDDLE, position=(0.7, 0.0, 0.0))])
    block = inward_box((0.6, -0.1, -0.1), (0.8, 0.1, 0.1), [0] * 6, outward=True)
    assert not rendered(device, replace(room, meshes=(*room.meshes, *block))).images["irradiance"].any()


def test_lamp_that_sees_nothing_lights_nothing(device: Device) -> None:
    away = Light("l", SPOT, (45.0, 45.0, 45.0), (0.0, 0.0, 5.0), (1, 0, 0), (0, -1, 0), (0, 0, -1), spot_angle=1.0)
    assert not rendered(device, empty_room([away])).images["irradiance"].any()


def test_frame_is_the_same_bit_for_bit_whatever_came_before(device: Device) -> None:
    room = box_room()
    first = rendered(device, room, 2)
    rendered(device, empty_room([LAMPS["area"], LAMPS["spot"]]), 1, indirect_lights=33)
    second = rendered(device, room, 2)
    for name, image in first.images.items():
        assert (image == second.images[name]).all(), name
    # Maps may be kept from what came before.
    before, after = ({**frame.counters, "reflective_maps_drawn": 0} for frame in (first, second))
    assert before == after
    assert first.images["indirect"].max() > 0.0


def slab_room() -> SceneSnapshot:
    """A lamp shines on the floor of a room; a slab above the floor shows its upper side, which faces away from that."""
    low, high = (-0.6, -0.6, 0.1), (0.6, 0.6, 0.2)
    spot = Light("l", SPOT, (200.0, 200.0, 200.0), (1.6, 0.0, 1.0), (1, 0, 0), (0, 1, 0), (0, 0, 1), spot_angle=0.7)
    room = empty_room([spot], ((0.6, 0.6, 0.6),))
    slab = inward_box(low, high, [0] * 6, outward=True)
    return replace(room, meshes=(*room.meshes, *slab), camera=camera_at((-1.0, 0.0, 1.1), (0.1, 0.0, 0.15), lens=22.0))


def test_negative_lights_take_away_what_a_slab_stops_and_never_more_than_all(device: Device) -> None:
    """Light of the floor that reaches the slab from below goes up from its visible side, negative."""
    scene = slab_room()
    without = rendered(device, scene, negative_lights=0, low_resolution=1)
    frame = rendered(device, scene, negative_lights=500, low_resolution=1)
    negative, positive = frame.images["second_order_negative"], frame.images["second_order_positive"]
    np.testing.assert_allclose(positive, without.images["second_order_positive"], rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(
        frame.images["irradiance"], np.maximum(positive - negative, 0.0), atol=0.05 * positive.max()
    )
    assert negative.max() > 0.0
    assert (frame.images["irradiance"] >= 0.0).all()
    assert (frame.images["irradiance"] <= without.images["irradiance"] + 1e-6).all()
    assert frame.counters["negative_lights"] > 10
    assert 0.0 < frame.counters["negative_removes_share"] < 0.5
    assert without.counters["negative_lights"] == without.counters["negative_removes_share"] == 0.0


def test_negative_lights_hold_the_light_that_the_visible_surface_stops(device: Device) -> None:
    """A camera that sees the dark side of one quad alone: their flux is that of a sum over the quad in numpy."""
    floor = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    lid = quad((-0.5, -0.5, 1.0), (1, 0, 0), (0, 1, 0))
    spot = Light("l", SPOT, (200.0, 200.0, 200.0), (1.5, 0.0, 0.9), (1, 0, 0), (0, 1, 0), (0, 0, 1), spot_angle=0.9)
    scene = replace(
        empty_room([spot], ((0.6, 0.6, 0.6),)),
        meshes=(floor, lid),
        camera=camera_at((0.0, 0.0, 2.5), (0.0, 0.0, 1.0), lens=60.0),
    )
    frame = rendered(device, scene, 1, 64, negative_lights=2000, indirect_lights=300)
    ((lights, _, gain),) = placed(device, scene, [300])
    places = (np.indices((40, 40)).reshape(2, -1).T + 0.5) / 40.0 - 0.5
    points = np.column_stack([places, np.ones(len(places))])
    down = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    stopped = vpl_irradiance(points, down, lights).irradiance.mean() * gain
    # Seen from 1.5 m with a lens of 60 mm on 36 x 27 mm the quad fills more than the picture.
    seen = (1.5 * 36.0 / 60.0) * (1.5 * 27.0 / 60.0)
    assert frame.counters["negative_flux"] == pytest.approx(stopped * seen, rel=0.1)


@pytest.mark.parametrize(
    ("scene", "value_threshold"),
    [(box_room(), 0.085), (empty_room([LAMPS["spot"]]), 0.07)],
    ids=["box room", "empty room"],
)
def test_low_resolution_is_right_to_half_a_percent_where_7_of_8_pixels_are(
    device: Device, scene: SceneSnapshot, value_threshold: float
) -> None:
    """Of the indirect light alone, at thresholds that leave about 87.5 % of the pixels (seed 001, table 2)."""
    full = rendered(device, scene, 1, 320, low_resolution=1)
    low = rendered(device, scene, 1, 320, value_threshold=value_threshold)
    assert full.counters["low_resolution_share"] == 0.0
    assert low.counters["low_resolution_share"] == pytest.approx(0.875, abs=0.015)
    assert 0.0 < relative_rmse(low.images["indirect"], full.images["indirect"]) < 0.005
    shown = full.images["normal"].any(axis=2)
    mask = low.images["second_order_discontinuity"][shown]
    assert mask.mean() == pytest.approx(1.0 - low.counters["low_resolution_share"], abs=0.01)


def test_a_scene_without_surfaces_has_no_lights(device: Device) -> None:
    nothing = replace(empty_room([MIDDLE]), meshes=())
    assert not rendered(device, nothing).plan.runs("indirect_light")
    frame = forced(device, nothing)
    assert not frame.images["combined"][..., :3].any()
    assert frame.counters["indirect_lights"] == frame.counters["low_resolution_share"] == 0


def test_lamps_that_cast_no_shadow_are_named(device: Device) -> None:
    frame = rendered(device, empty_room([replace(MIDDLE, name="Ghost", casts_shadow=False), LAMPS["spot"]]))
    assert len(frame.reasons) == 1
    assert "Ghost" in frame.reasons[0]


def test_lights_are_marked_in_the_picture_where_they_are(device: Device) -> None:
    frame = rendered(device, box_room(), 1, 64, indirect_lights=40, negative_lights=0)
    marks = frame.images["second_order_lights"]
    assert 20 <= (marks == 1.0).all(axis=2).sum() <= 40 * 9


def test_names_of_buffers_begin_with_the_techniques(device: Device) -> None:
    names = {name for name in rendered(device, box_room()).images if name.startswith("second_order")}
    parts = ("positive", "negative", "discontinuity", "low_resolution", "lights")
    maps = {f"second_order_map_0_{part}" for part in ("position", "normal", "flux", "depth")}
    assert names == {f"second_order_{part}" for part in parts} | maps
