# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflective shadow maps: what they hold is where it should be, and their flux is the lamp's power that arrives."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.render.closed_rooms import ROOM_SIZE, empty_room, inward_box
from tests.render.rooms import camera_at, quad
from vlm_addon.core.brdf import diffuse_reflectance
from vlm_addon.core.lamps import lamp_irradiance, spot_attenuation
from vlm_addon.core.scene import AREA, DIFFUSE, POINT, PRINCIPLED, SPOT, SUN, Float64, Light, Material, SceneSnapshot
from vlm_addon.core.world_light import merged_world_lights, world_lights
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.passes import rsm
from vlm_addon.render.passes.rsm import LampReflections, ReflectiveShadowMap, ReflectiveShadowMapPass

POWER = (10.0, 20.0, 30.0)
GREY = ((0.5, 0.25, 0.75),)
TILTED = {"x_axis": (0.8, 0.0, -0.6), "y_axis": (0.0, 1.0, 0.0), "z_axis": (0.6, 0.0, 0.8)}
PLACE = (0.7, -0.4, 0.5)
RESOLUTION = 64
LAMPS = {
    "point": Light("l", POINT, POWER, PLACE),
    "spot": Light("l", SPOT, POWER, PLACE, **TILTED, spot_angle=1.2, spot_blend=0.5),
    "squashed spot": Light("l", SPOT, POWER, PLACE, **TILTED, spot_angle=1.2, spot_blend=0.2, spot_scale=(0.4, 1.0)),
    "wide spot": Light("l", SPOT, POWER, PLACE, **TILTED, spot_angle=2.8, spot_blend=1.0),
    "rectangle": Light("l", AREA, POWER, PLACE, **TILTED, size_x=0.6, size_y=0.3),
    "ellipse": Light("l", AREA, POWER, PLACE, **TILTED, size_x=0.6, size_y=0.3, shape="ELLIPSE"),
}


def sent_share(light: Light) -> float:
    """Of the lamp's nominal power, that leaves it."""
    if light.kind != SPOT:
        return 1.0
    height, azimuth = np.meshgrid((np.arange(4000) + 0.5) / 4000, np.arange(400) * (2.0 * np.pi / 400), indexing="ij")
    ring = np.sqrt(1.0 - height**2)
    local = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), -height], axis=-1).reshape(-1, 3)
    directions = local @ np.array([light.x_axis, light.y_axis, light.z_axis])
    return 0.5 * float(spot_attenuation(light, directions).mean())


def total_flux(device: Device, snapshot: SceneSnapshot, count: int = 1, resolution: int = RESOLUTION) -> Float64:
    """(3,) W: over all maps of all lamps."""
    with device.current() as context:
        maps = LampReflections(context, device.shaders, Kept(), snapshot, resolution, count)
        return np.sum([found.total_flux() * found.space.unit**2 for found in maps.maps()] + [np.zeros(3)], axis=0)


def one_map(
    device: Device, snapshot: SceneSnapshot, resolution: int = RESOLUTION
) -> tuple[ReflectiveShadowMap, Float64]:
    """Of the first lamp, and the geometry's origin; within `device.current()`."""
    geometry = GpuGeometry(device.context, snapshot)
    maps = ReflectiveShadowMapPass(device.context, device.shaders, resolution)
    return maps.render(geometry, snapshot.lights[0], 0, 1), geometry.origin


def texels(texture) -> Float64:
    width, height = texture.size
    return np.frombuffer(texture.read(), np.float32).reshape(height, width, 4).astype(float)


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("name", LAMPS)
def test_flux_in_a_closed_room_is_its_reflectance_times_the_lamps_power(device: Device, name: str, count: int) -> None:
    light = LAMPS[name]
    found = total_flux(device, empty_room([light], GREY), count)
    np.testing.assert_allclose(found, np.array(GREY[0]) * POWER * sent_share(light), rtol=0.005)


def test_flux_of_walls_of_many_colours_is_what_each_of_them_receives(device: Device) -> None:
    snapshot = empty_room([LAMPS["point"]])
    expected = np.zeros(3)
    steps = (np.arange(200) + 0.5) / 200
    for mesh, material in zip(snapshot.meshes, snapshot.materials, strict=True):
        corner, along, _, across = mesh.positions
        u, v = along - corner, across - corner
        points = corner + steps[:, None, None] * u + steps[:, None] * v
        normals = np.broadcast_to(mesh.corner_normals[0, 0].astype(float), (40_000, 3))
        received = lamp_irradiance(snapshot.lights[0], points.reshape(-1, 3), normals).mean(axis=0)
        expected += material.base_color * received * np.linalg.norm(np.cross(u, v))
    np.testing.assert_allclose(total_flux(device, snapshot), expected, rtol=0.005)


@pytest.mark.parametrize("soft_falloff", [True, False])
@pytest.mark.parametrize("kind", [POINT, SPOT])
def test_large_lamps_light_a_floor_as_the_oracle_says(device: Device, kind: str, soft_falloff: bool) -> None:
    light = Light(
        "l", kind, POWER, (0.1, 0.2, 1.0), radius=0.4, soft_falloff=soft_falloff, spot_angle=2.5, spot_blend=0.4
    )
    floor = quad((-3.0, -3.0, 0.0), (6.0, 0.0, 0.0), (0.0, 6.0, 0.0))
    snapshot = SceneSnapshot("floor", (floor,), (Material("m", DIFFUSE, GREY[0]),), lights=(light,))
    x, y = np.meshgrid(*2 * [(np.arange(300) + 0.5) / 50 - 3.0])
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    received = lamp_irradiance(light, points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    expected = np.array(GREY[0]) * received.mean(axis=0) * 36.0
    np.testing.assert_allclose(total_flux(device, snapshot), expected, rtol=0.01)


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_flux_of_a_sun_is_its_irradiance_on_the_footprint(device: Device, angle: float) -> None:
    """A tilted sun on a floor of 4 m x 2 m: what it brings to the floor, which all of it sees."""
    sun = Light("l", SUN, POWER, (0.0, 0.0, 0.0), **TILTED, angle=angle)
    floor = quad((-2.0, -1.0, 0.0), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    snapshot = SceneSnapshot("floor", (floor,), (Material("m", DIFFUSE, GREY[0]),), lights=(sun,))
    expected = np.array(GREY[0]) * lamp_irradiance(sun, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))[0] * 8.0
    np.testing.assert_allclose(total_flux(device, snapshot, 9, 256), expected, rtol=0.01)


def test_sun_lights_what_stands_before_and_not_what_is_behind(device: Device) -> None:
    sun = Light("l", SUN, POWER, (0.0, 0.0, 0.0))
    floor = quad((-2.0, -1.0, 0.0), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0), material=0)
    table = quad((-1.0, -1.0, 0.5), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), material=1)
    materials = (Material("floor", DIFFUSE, (1.0, 0.0, 0.0)), Material("table", DIFFUSE, (0.0, 1.0, 0.0)))
    found = total_flux(device, SceneSnapshot("s", (floor, table), materials, lights=(sun,)), resolution=256)
    np.testing.assert_allclose(found, [POWER[0] * 4.0, POWER[1] * 4.0, 0.0], rtol=0.01)


def test_principled_walls_reflect_their_diffuse_share(device: Device) -> None:
    snapshot = empty_room([LAMPS["point"]], GREY)
    glossy = Material("m", PRINCIPLED, GREY[0], roughness=0.3, metallic=0.25, ior=1.6, specular_ior_level=0.8)
    reflectance = diffuse_reflectance(np.array(GREY[0]), 0.25, 1.6, 0.8, 0.3, PRINCIPLED)
    found = total_flux(device, replace(snapshot, materials=(glossy,) * 6))
    np.testing.assert_allclose(found, reflectance * POWER, rtol=0.006)


@pytest.mark.parametrize("name", ["point", "spot", "wide spot", "rectangle"])
def test_texels_hold_the_surface_that_the_lamp_sees(device: Device, name: str) -> None:
    with device.current():
        found, origin = one_map(device, empty_room([LAMPS[name]]))
        position, normal, flux = (texels(texture) for texture in (found.position, found.normal, found.flux))
    shown = normal[..., 3] > 0.0
    assert shown.any()
    points, normals = position[shown][:, :3] + origin, normal[shown][:, :3]
    half = 0.5 * np.array(ROOM_SIZE)
    distance_to_wall = np.abs(np.abs(points) - half)
    axis = distance_to_wall.argmin(axis=1)
    rows = np.arange(len(points))
    assert distance_to_wall[rows, axis].max() < 1e-4
    assert (np.abs(points) <= half + 1e-4).all()
    expected = np.zeros_like(normals)
    expected[rows, axis] = -np.sign(points[rows, axis])
    # In a corner either wall may be the nearest.
    clear = np.sort(distance_to_wall, axis=1)[:, 1] > 1e-3
    np.testing.assert_allclose(normals[clear], expected[clear], atol=1e-6)
    assert (flux[..., :3][~shown] == 0.0).all()
    assert found.brightest.min() > 0.0


def test_depth_is_the_distance_along_the_faces_axis(device: Device) -> None:
    with device.current():
        found, origin = one_map(device, empty_room([LAMPS["point"]]))
        position = texels(found.position)
    side = found.side
    for face in range(6):
        column, row = face % 3, face // 3
        tile = position[row * side : (row + 1) * side, column * side : (column + 1) * side]
        axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
        ahead = sign * ((tile[..., :3] + origin) - PLACE)[..., axis]
        np.testing.assert_allclose(tile[..., 3], ahead, rtol=1e-5)
        assert (tile[..., 3] > 0.0).all()


def test_areas_of_texels_sum_to_the_walls(device: Device) -> None:
    with device.current():
        found, _ = one_map(device, empty_room([LAMPS["point"]]), 128)
        area = texels(found.normal)[..., 3].sum()
    x, y, z = ROOM_SIZE
    assert area == pytest.approx(2.0 * (x * y + y * z + z * x), rel=0.005)


@pytest.mark.parametrize(
    ("name", "measure"), [("point", 4.0 * math.pi), ("spot", 1.0), ("wide spot", 10.0 / 3.0 * math.pi)]
)
def test_every_level_holds_all_of_the_flux_and_of_the_map(device: Device, name: str, measure: float) -> None:
    with device.current():
        found, _ = one_map(device, empty_room([LAMPS[name]]))
        levels = [found.flux_level(level).astype(float) for level in range(found.levels)]
        total = found.total_flux()
    columns, rows = (3, 2) if found.is_cube else (1, 1)
    assert levels[-1].shape == (rows, columns, 4)
    for finer, coarser in pairwise(levels):
        summed = finer.reshape(coarser.shape[0], 2, coarser.shape[1], 2, 4).sum(axis=(1, 3))
        np.testing.assert_allclose(coarser, summed, rtol=1e-5)
    np.testing.assert_allclose(total, levels[0][..., :3].sum(axis=(0, 1)), rtol=1e-5)
    assert levels[0][..., 3].sum() == pytest.approx(measure, rel=1e-3)


def test_brightest_is_the_greatest_radiosity(device: Device) -> None:
    """Below a lamp 0.5 m under a ceiling: reflectance x intensity / 0.25 m²."""
    light = replace(LAMPS["point"], position=(0.3, 0.2, 0.75))
    with device.current():
        found, _ = one_map(device, empty_room([light], GREY), 256)
    np.testing.assert_allclose(found.brightest, np.array(GREY[0]) * POWER / (4.0 * math.pi * 0.25), rtol=1e-3)


def test_lamp_inside_a_wall_or_outside_of_everything_reflects_nothing(device: Device) -> None:
    room = empty_room([LAMPS["point"]], GREY)
    block = inward_box((0.5, -0.6, 0.3), (0.9, -0.2, 0.7), [0] * 6, outward=True)
    assert not total_flux(device, replace(room, meshes=(*room.meshes, *block))).any()
    outside = replace(LAMPS["point"], position=(9.0, 0.0, 0.0))
    assert not total_flux(device, replace(room, lights=(outside,))).any()
    away = replace(LAMPS["spot"], position=(0.0, 0.0, 5.0), x_axis=(1.0, 0.0, 0.0), z_axis=(0.0, 0.0, -1.0))
    assert not total_flux(device, replace(room, lights=(away,))).any()


@pytest.mark.parametrize("name", LAMPS)
def test_scene_without_surfaces_gives_an_empty_map(device: Device, name: str) -> None:
    assert not total_flux(device, SceneSnapshot("nothing", lights=(LAMPS[name],))).any()


def test_ten_lamps_add_up_and_dark_ones_have_no_map(device: Device) -> None:
    lamps = [replace(LAMPS["point"], position=(0.15 * i - 0.7, 0.1, 0.2), power=(i, 1.0, 2.0)) for i in range(10)]
    dark = replace(LAMPS["point"], power=(0.0, 0.0, 0.0))
    room = empty_room([*lamps, dark], GREY)
    np.testing.assert_allclose(total_flux(device, room), np.array(GREY[0]) * (45.0, 10.0, 20.0), rtol=0.005)
    with device.current() as context:
        maps = LampReflections(context, device.shaders, Kept(), room, RESOLUTION, 4)
        for _ in range(3):
            assert len(list(maps.maps())) == len(maps) == 10
        assert maps.drawn == 10


def test_maps_beyond_the_cache_are_drawn_again_and_are_the_same(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Faces that one lamp does not draw hold nothing of the lamp before."""
    room = empty_room([LAMPS["point"], LAMPS["wide spot"], LAMPS["rectangle"]])
    kept = total_flux(device, room, 2)
    monkeypatch.setattr(rsm, "CACHE_BYTES", 0)
    with device.current() as context:
        maps = LampReflections(context, device.shaders, Kept(), room, RESOLUTION, 2)
        for _ in range(2):
            found = [found.total_flux() * found.space.unit**2 for found in maps.maps()]
            assert (np.sum(found, axis=0) == kept).all()
        assert maps.drawn == 8


def test_far_from_the_origin_and_large_it_is_the_same_light(device: Device) -> None:
    """The pass works from the geometry's own origin: a room 100 km away."""
    light = LAMPS["point"]
    near = empty_room([light], GREY)
    offset = np.array([1e5, -1e5, 1e5])
    meshes = tuple(replace(mesh, positions=mesh.positions + offset) for mesh in near.meshes)
    moved = replace(light, position=tuple((np.array(PLACE) + offset).tolist()))
    np.testing.assert_allclose(
        total_flux(device, replace(near, meshes=meshes, lights=(moved,))), total_flux(device, near), rtol=1e-4
    )


@pytest.mark.parametrize(
    ("lamp", "distance"),
    [(lamp, distance) for lamp in ("point", "spot") for distance in (5.0, 100.0, 1e5)]
    # Float32 knows no narrower cone from farther away.
    + [("narrow spot", 5.0), ("narrow spot", 100.0)],
)
def test_distant_lamps_see_the_scene_as_sharply_as_near_ones(device: Device, lamp: str, distance: float) -> None:
    """A floor of 4 m x 2 m; the narrow spot lights a part of it."""
    floor = quad((-2.0, -1.0, 0.0), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0), material=0)
    place = (0.3 * distance, 0.1 * distance, distance)
    backward = np.array(place) / np.linalg.norm(place)
    x_axis = np.cross((0.0, 1.0, 0.0), backward)
    x_axis /= np.linalg.norm(x_axis)
    axes = {"x_axis": tuple(x_axis), "y_axis": tuple(np.cross(backward, x_axis)), "z_axis": tuple(backward)}
    angle = 1.0 if lamp == "spot" else 2.0 * math.atan(1.0 / np.linalg.norm(place))
    kind = POINT if lamp == "point" else SPOT
    light = Light("l", kind, tuple(np.array(POWER) * distance**2), place, **axes, spot_angle=angle, spot_blend=0.3)
    snapshot = SceneSnapshot("s", (floor,), (Material("floor", DIFFUSE, (0.5, 0.5, 0.5)),), lights=(light,))
    x, y = np.meshgrid((np.arange(800) + 0.5) / 200 - 2.0, (np.arange(400) + 0.5) / 200 - 1.0)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    received = lamp_irradiance(light, points, np.tile([0.0, 0.0, 1.0], (len(points), 1))).mean(axis=0) * 8.0
    np.testing.assert_allclose(total_flux(device, snapshot), 0.5 * received, rtol=0.01)


@pytest.mark.parametrize(
    "light",
    [
        Light("l", AREA, POWER, PLACE, size_x=0.0, size_y=0.0),
        Light("l", AREA, POWER, PLACE, size_x=1e-6, size_y=1e-6),
        Light("l", SPOT, POWER, PLACE, spot_angle=math.pi, spot_blend=0.0),
        Light("l", SPOT, POWER, PLACE, spot_angle=1e-6, spot_blend=1.0),
        Light("l", SPOT, POWER, PLACE, spot_angle=1.0, spot_scale=(0.0, 1.0)),
        Light("l", POINT, POWER, (2.0, 1.5, 1.25)),
        Light("l", POINT, POWER, (0.0, 0.0, -1.25)),
        Light("l", POINT, POWER, PLACE, radius=50.0),
        Light("l", SUN, POWER, PLACE, angle=math.pi),
        Light("l", SUN, POWER, PLACE, x_axis=(0.0, 0.0, -1.0), z_axis=(1.0, 0.0, 0.0)),
    ],
    ids=["no area", "tiny", "half space", "no cone", "flat cone", "in a corner", "in a wall", "huge", "dome", "level"],
)
def test_extreme_lamps_give_finite_flux_and_no_more_than_they_send(device: Device, light: Light) -> None:
    room = empty_room([light], GREY)
    with device.current() as context:
        for found in LampReflections(context, device.shaders, Kept(), room, RESOLUTION, 4).maps():
            for texture in (found.position, found.normal, found.flux):
                assert np.isfinite(texels(texture)).all()
            assert (found.flux_level(0) >= 0.0).all()
            assert np.isfinite(found.brightest).all()
    if light.kind != SUN:
        assert (total_flux(device, room, 4) <= 1.01 * np.array(GREY[0]) * POWER).all()


def test_through_alpha_a_share_of_the_light_goes_on(device: Device) -> None:
    """A sun through a pane of alpha 0.25 before the floor."""
    sun = Light("l", SUN, POWER, (0.0, 0.0, 0.0))
    floor = quad((-1.0, -1.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), material=0)
    pane = quad((-1.0, -1.0, 0.5), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), material=1)
    materials = (Material("floor", DIFFUSE, (1.0, 0.0, 0.0)), Material("pane", DIFFUSE, (0.0, 1.0, 0.0), alpha=0.25))
    found = total_flux(device, SceneSnapshot("s", (floor, pane), materials, lights=(sun,)), resolution=128)
    np.testing.assert_allclose(found, [POWER[0] * 4.0 * 0.75, POWER[1] * 4.0 * 0.25, 0.0], rtol=0.02)


def test_camera_and_lamp_agree_on_which_side_is_the_back(device: Device) -> None:
    """A floor seen from below reflects nothing into the map, as its virtual lights would not."""
    below = Light("l", POINT, POWER, (0.0, 0.0, -1.0))
    floor = quad((-2.0, -1.0, 0.0), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    snapshot = SceneSnapshot("s", (floor,), (Material("m"),), lights=(below,), camera=camera_at((0, 0, 1), (0, 0, 0)))
    assert not total_flux(device, snapshot).any()
    assert total_flux(device, replace(snapshot, lights=(replace(below, position=(0.0, 0.0, 1.0)),))).all()


@pytest.mark.parametrize(("count", "bound"), [(64, 0.02), (16, 0.05), (4, 0.2)])
def test_flux_of_an_even_world_is_that_of_its_irradiance(device: Device, count: int, bound: float) -> None:
    """An open floor receives pi times the radiance, less what comes over the horizon from suns that are below it."""
    suns = world_lights((0.5, 1.0, 2.0), None, 64)
    floor = quad((-2.0, -1.0, 0.0), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    snapshot = SceneSnapshot("s", (floor,), (Material("m", DIFFUSE, GREY[0]),), lights=merged_world_lights(suns, count))
    expected = np.array(GREY[0]) * np.pi * (0.5, 1.0, 2.0) * 8.0
    np.testing.assert_allclose(total_flux(device, snapshot, resolution=32), expected, rtol=bound)
