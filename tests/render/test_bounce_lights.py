# SPDX-License-Identifier: GPL-3.0-or-later
"""The second and third bounces: all of the light that is reflected, where radiosity in numpy says that it goes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import trimesh

from tests.render.closed_rooms import ROOM_REFLECTANCES, ROOM_SIZE, empty_room, inward_box, room_area, wall_points
from tests.render.flux_lights import as_lights, walked
from tests.render.rooms import quad
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.scene import DIFFUSE, POINT, SUN, Float64, Light, Material, Mesh, SceneSnapshot
from vlm_addon.core.vpl import VirtualPointLights, vpl_irradiance
from vlm_addon.render.device import Device
from vlm_addon.render.local_space import LocalSpace

LAMP = Light("point", POINT, (45.0, 30.0, 20.0), (0.4, -0.3, 0.9))
GREY = np.array([0.5, 0.25, 0.75])
BLOCK_LOW, BLOCK_HIGH = (-0.6, -0.5, -1.25), (0.3, 0.6, 0.1)
BLOCK_REFLECTANCE = (0.2, 0.7, 0.4)
FLOOR_WALL = 4
"""Among those of wall_points."""
DOWN = Light("sun", SUN, (2.0, 2.0, 2.0), (0.0, 0.0, 0.0))
WHITE = Material("white", DIFFUSE, (0.8, 0.8, 0.8))
SHIFTS = [tuple(shift) for shift in np.random.default_rng(8).random((16, 2)).tolist()]
FLOOR = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), name="floor")


def with_block(room: SceneSnapshot, reflectance: tuple[float, float, float]) -> SceneSnapshot:
    """A solid on the floor of the room, between the lamp and some of the walls."""
    block = inward_box(BLOCK_LOW, BLOCK_HIGH, [len(room.materials)] * 6, outward=True)
    materials = (*room.materials, Material("block", DIFFUSE, reflectance))
    return replace(room, meshes=(*room.meshes, *block), materials=materials)


GREY_ROOM = empty_room([LAMP], (tuple(GREY),))
FURNACES = {"empty": GREY_ROOM, "block": with_block(GREY_ROOM, tuple(GREY))}
COLOURED = {"empty": empty_room([LAMP]), "block": with_block(empty_room([LAMP]), BLOCK_REFLECTANCE)}


@pytest.mark.parametrize("name", FURNACES)
def test_each_bounce_in_a_closed_room_carries_what_the_one_before_reflects(device: Device, name: str) -> None:
    """However many lights go on, none is lost: at edges and corners, and where block and floor meet."""
    (found,) = walked(device, FURNACES[name], (2000, 1100, 600))
    for bounce, records in enumerate(found, 1):
        np.testing.assert_allclose(records["flux"].sum(axis=0), GREY**bounce * LAMP.power, rtol=0.005)
        assert (records["flux"].max(axis=1) > 0.0).all()


def closed_sphere() -> SceneSnapshot:
    """1,280 flat triangles that face the middle, and a lamp beside it."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.7)
    triangles = ball.faces[:, ::-1].astype(np.int32)
    count = len(triangles)
    normals = -ball.face_normals.astype(np.float32)
    mesh = Mesh(
        name="sphere",
        positions=np.array(ball.vertices, np.float64),
        triangles=np.ascontiguousarray(triangles),
        corner_normals=np.ascontiguousarray(np.repeat(normals[:, None], 3, axis=1)),
        corner_uvs=np.zeros((count, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.zeros(count, np.int32),
        tag_ids=np.zeros(count, np.int32),
        reflectance=np.zeros((count, 3), np.float32),
        emission=np.zeros((count, 3), np.float32),
    )
    return SceneSnapshot("sphere", (mesh,), (Material("grey", DIFFUSE, tuple(GREY)),), lights=(LAMP,))


def test_nothing_is_lost_between_the_triangles_of_a_sphere(device: Device) -> None:
    (found,) = walked(device, closed_sphere(), (4000, 4000, 4000))
    for bounce, records in enumerate(found, 1):
        np.testing.assert_allclose(records["flux"].sum(axis=0), GREY**bounce * LAMP.power, rtol=0.005)
    assert min(int((records["flux"].max(axis=1) > 0.0).sum()) for records in found) >= 3999


@pytest.mark.parametrize("number", [2, 3])
def test_lights_of_a_bounce_lie_on_surfaces_and_face_where_their_light_comes_from(device: Device, number: int) -> None:
    (found,) = walked(device, GREY_ROOM, (2000, 1000, 500))
    before, records = found[number - 2][: len(found[number - 1])], found[number - 1]
    half = 0.5 * np.array(ROOM_SIZE)
    outside = np.abs(np.abs(records["position"]) - half).min(axis=1)
    assert outside.max() < 1e-4
    towards = before["position"] - records["position"]
    assert ((towards * records["geometric_normal"]).sum(axis=1) > 0.0).all()
    assert ((towards * before["normal"]).sum(axis=1) < 0.0).all()
    np.testing.assert_array_equal(records["normal"], records["geometric_normal"])
    assert records["area"].sum() == pytest.approx(room_area(), rel=1e-4)


@dataclass(frozen=True)
class Patches:
    """Pieces of surface: middles and normals, (n, 3); areas, (n,); reflectances, (n, 3); irradiance of bounce 0, (n, 3)
    from the lamp, and of the bounces after it."""

    middles: Float64
    normals: Float64
    areas: Float64
    reflectances: Float64
    irradiance: list[Float64]


def box_patches(low: Float64, high: Float64, steps: int, outward: bool) -> tuple[Float64, Float64, Float64]:
    """steps x steps middles, normals and areas of each side, sides in the order of inward_box."""
    middles, normals, areas = [], [], []
    at = (np.arange(steps) + 0.5) / steps
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for at_high in (0, 1):
            grid = np.zeros((steps, steps, 3))
            grid[..., first], grid[..., second] = np.meshgrid(at, at)
            grid[..., axis] = at_high
            middles.append((low + grid * (high - low)).reshape(-1, 3))
            sign = (2.0 * at_high - 1.0) * (1.0 if outward else -1.0)
            normals.append(np.tile(sign * np.eye(3)[axis], (steps**2, 1)))
            areas.append(np.full(steps**2, (high - low)[first] * (high - low)[second] / steps**2))
    return np.concatenate(middles), np.concatenate(normals), np.concatenate(areas)


def block_hides(starts: Float64, ends: Float64) -> Float64:
    """(...) whether the block's inside is between places."""
    along = np.where(ends == starts, 1e-12, ends - starts)
    near, far = ((np.array(side) - starts) / along for side in (BLOCK_LOW, BLOCK_HIGH))
    enters, leaves = np.minimum(near, far).max(axis=-1), np.maximum(near, far).min(axis=-1)
    return np.minimum(leaves, 1.0) - np.maximum(enters, 0.0) > 1e-6


@cache
def radiosity(name: str) -> Patches:
    """Of the coloured rooms, in numpy: two bounces after the lamp's light, with rows of form factors that add up to 1,
    as in every closed room."""
    half = 0.5 * np.array(ROOM_SIZE)
    middles, normals, areas = box_patches(-half, half, 16, False)
    reflectances = np.repeat(ROOM_REFLECTANCES, 16**2, axis=0)
    if name == "block":
        parts = box_patches(np.array(BLOCK_LOW), np.array(BLOCK_HIGH), 8, True)
        under_block = (middles[:, 2] == -half[2]) & ((middles > BLOCK_LOW) & (middles < BLOCK_HIGH))[:, :2].all(axis=1)
        middles, normals, areas = (
            np.concatenate([wall[~under_block], side])
            for wall, side in zip((middles, normals, areas), parts, strict=True)
        )
        reflectances = np.concatenate([reflectances[~under_block], np.tile(BLOCK_REFLECTANCE, (6 * 8**2, 1))])
    lit = lamp_irradiance(LAMP, middles, normals)
    if name == "block":
        lit[block_hides(np.broadcast_to(LAMP.position, middles.shape), middles)] = 0.0
    factors = []
    for middle, normal in zip(middles, normals, strict=True):
        towards = middles - middle
        squared = (towards**2).sum(axis=1)
        facing = np.maximum(towards @ normal, 0.0) * np.maximum(-(towards * normals).sum(axis=1), 0.0)
        row = facing * areas / np.maximum(squared * (np.pi * squared + areas), 1e-30)
        if name == "block":
            row[block_hides(np.broadcast_to(middle, middles.shape), middles)] = 0.0
        factors.append(row / max(row.sum(), 1e-30))
    irradiance = [lit]
    for _ in range(2):
        irradiance.append(np.array(factors) @ (reflectances * irradiance[-1]))
    return Patches(middles, normals, areas, reflectances, irradiance)


@cache
def coloured_walk(device: Device, name: str) -> list[list[np.ndarray]]:
    return walked(device, COLOURED[name], (4096, 2048, 1024), shifts=SHIFTS)


@pytest.mark.parametrize("bounce", [1, 2, 3])
@pytest.mark.parametrize("name", COLOURED)
def test_flux_of_each_bounce_is_that_of_radiosity(device: Device, name: str, bounce: int) -> None:
    patches = radiosity(name)
    expected = patches.areas @ (patches.reflectances * patches.irradiance[bounce - 1])
    found = np.mean([walk[bounce - 1]["flux"].sum(axis=0) for walk in coloured_walk(device, name)], axis=0)
    np.testing.assert_allclose(found, expected, rtol=0.02)


@pytest.mark.parametrize("bounce", [2, 3])
@pytest.mark.parametrize("name", COLOURED)
def test_light_of_each_bounce_comes_from_where_radiosity_says(device: Device, name: str, bounce: int) -> None:
    """What it brings to points away from the block if nothing stood in the way, on average over the shifts."""
    points, normals, wall = wall_points(60, seed=3, margin=0.6)
    points, normals = points[wall != FLOOR_WALL], normals[wall != FLOOR_WALL]
    patches = radiosity(name)
    flux = patches.reflectances * patches.irradiance[bounce - 1] * patches.areas[:, None]
    sent = VirtualPointLights(patches.middles, patches.normals, flux, np.zeros(len(flux)))
    expected = vpl_irradiance(points, normals, sent).irradiance
    sums = [
        vpl_irradiance(points, normals, as_lights(walk[bounce - 1])).irradiance for walk in coloured_walk(device, name)
    ]
    error = np.mean(sums, axis=0) - expected
    assert np.sqrt((error**2).mean()) < 0.03 * expected.mean()
    np.testing.assert_allclose(error.mean(axis=0) / expected.mean(axis=0), 0.0, atol=0.015)


def test_fewer_lights_that_go_on_stand_for_all(device: Device) -> None:
    """The same sum on average, whatever the split."""
    sums = []
    for count in (64, 256, 1024):
        found = walked(device, COLOURED["empty"], (1024, count), shifts=SHIFTS)
        sums.append(np.mean([records["flux"].sum(axis=0) for _, records in found], axis=0))
    np.testing.assert_allclose(sums[0], sums[2], rtol=0.03)
    np.testing.assert_allclose(sums[1], sums[2], rtol=0.015)


def test_even_a_few_lights_are_right_in_the_mean_over_shifts(device: Device) -> None:
    """Four of each bounce, 1,500 times over, beside 60,000: places and directions have to be independent."""
    shifts = [tuple(shift) for shift in np.random.default_rng(0).random((1500, 2)).tolist()]
    few = walked(device, COLOURED["block"], (4, 4), shifts=shifts)
    ((_, many),) = walked(device, COLOURED["block"], (60_000, 60_000))
    found = np.mean([records["flux"].sum(axis=0) for _, records in few], axis=0)
    np.testing.assert_allclose(found, many["flux"].sum(axis=0), rtol=0.01)


TILTED = replace(FLOOR, corner_normals=np.broadcast_to(np.array([0.8, 0.0, 0.6], np.float32), (2, 3, 3)).copy())
LEADS_NOWHERE = {
    "open floor": (FLOOR,),
    "smooth normals that point into their own floor": (TILTED,),
    "the clockwise side of a ceiling": (FLOOR, quad((-9, -9, 4), (18, 0, 0), (0, 18, 0))),
}


@pytest.mark.parametrize("name", LEADS_NOWHERE)
def test_light_that_meets_nothing_that_reflects_ends(device: Device, name: str) -> None:
    """A lamp over a floor, whose light goes up and never comes back."""
    lamp = Light("point", POINT, (10.0, 10.0, 10.0), (0.0, 0.0, 1.0))
    (found,) = walked(device, SceneSnapshot("s", LEADS_NOWHERE[name], (WHITE,), lights=(lamp,)), (500, 300, 200))
    assert found[0]["flux"].min() > 0.0
    for records in found[1:]:
        assert all(not records[field].any() for field in ("flux", "area", "normal", "geometric_normal"))
        assert np.isfinite(records["position"]).all()


def test_black_lights_stay_black(device: Device) -> None:
    (found,) = walked(device, empty_room([]), (50, 30, 20))
    assert not any(records["flux"].any() for records in found)


def test_no_light_goes_on_for_a_count_of_0(device: Device) -> None:
    (found,) = walked(device, GREY_ROOM, (50, 0, 0))
    assert [len(records) for records in found] == [50, 0, 0]


def test_units_are_those_of_the_space(device: Device) -> None:
    space = LocalSpace(np.array([3.0, -2.0, 1.0]), 0.01)
    (world,) = walked(device, COLOURED["block"], (600, 300, 200))
    (local,) = walked(device, COLOURED["block"], (600, 300, 200), space=space)
    for one, other in zip(world[1:], local[1:], strict=True):
        places = space.world_points(other["position"].astype(float))
        # Rounding sends a way or two past an edge of the block.
        same = np.isclose(places, one["position"], atol=1e-3).all(axis=1)
        assert same.mean() > 0.99
        np.testing.assert_allclose(other["flux"][same] * 0.01**2, one["flux"][same], rtol=1e-4)
        np.testing.assert_allclose(other["area"][same] * 0.01**2, one["area"][same], rtol=1e-4)


def test_two_bounces_of_the_same_scene_are_the_same_bits(device: Device) -> None:
    first, second = walked(device, COLOURED["block"], (300, 200, 100), shifts=[SHIFTS[0]] * 2)
    for one, other in zip(first, second, strict=True):
        assert all((one[field] == other[field]).all() for field in one.dtype.names)
