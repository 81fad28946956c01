# SPDX-License-Identifier: GPL-3.0-or-later
"""Light gathered from reflective shadow maps against closed forms and sums over the walls of a room.

In a closed room of one reflectance all that a lamp sends out arrives once on the walls and, reflected, once more: the
mean over the walls of the irradiance of one bounce is reflectance x power / area. What single points receive is summed
over a fine grid on the walls in numpy, without the code under test.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.render.closed_rooms import ROOM_REFLECTANCES, ROOM_SIZE, empty_room, inward_box, room_area, wall_points
from tests.render.gathering import COLUMNS, gathered
from tests.render.rooms import camera_at
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import AREA, POINT, SPOT, SUN, Float64, Light, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.passes.rsm_gather import SQUARED, UNBIASED, sample_taps

WATTS = (45.0, 45.0, 45.0)
"""Of the lamp in the sample scene empty_room, a point in its middle."""
LAMPS = {
    "point in the middle": Light("l", POINT, WATTS, (0.0, 0.0, 0.0)),
    "point near the ceiling": Light("l", POINT, WATTS, (0.4, -0.3, 0.9)),
    "spot": Light("l", SPOT, WATTS, (0.5, 0.2, 0.9), spot_angle=1.5, spot_blend=0.3),
    "wide spot": Light("l", SPOT, WATTS, (0.5, 0.2, 0.9), spot_angle=2.8, spot_blend=0.3),
    "area": Light("l", AREA, WATTS, (0.0, 0.0, 1.2), size_x=1.0, size_y=0.8),
}
MIDDLE = LAMPS["point in the middle"]


def reflected_power(light: Light) -> Float64:
    """(3,) W: what the walls of empty_room reflect of `light`, summed over a grid of points."""
    points, normals, areas, walls = wall_grid(60)
    received = lamp_irradiance(light, points, normals)
    return (np.array(ROOM_REFLECTANCES)[walls] * received * areas[:, None]).sum(axis=0)


def wall_grid(steps: int) -> tuple[Float64, Float64, Float64, npt.NDArray[np.int64]]:
    """Middles of steps x steps pieces of each wall, their inward normals, areas and walls."""
    size = np.array(ROOM_SIZE)
    middles = (np.arange(steps) + 0.5) / steps - 0.5
    points, normals, areas, walls = [], [], [], []
    for wall in range(6):
        axis, sign = wall // 2, 2.0 * (wall % 2) - 1.0
        first, second = (axis + 1) % 3, (axis + 2) % 3
        grid = np.zeros((steps * steps, 3))
        grid[:, first], grid[:, second] = (part.ravel() for part in np.meshgrid(middles, middles))
        grid[:, axis] = 0.5 * sign
        points.append(grid * size)
        normals.append(np.tile(-sign * np.eye(3)[axis], (len(grid), 1)))
        areas.append(np.full(len(grid), size[first] * size[second] / len(grid)))
        walls.append(np.full(len(grid), wall))
    return np.concatenate(points), np.concatenate(normals), np.concatenate(areas), np.concatenate(walls)


def one_bounce(light: Light, points: Float64, normals: Float64, steps: int = 150) -> Float64:
    """(p, 3) W/m²: by a sum over a fine grid on the walls."""
    sources, facing, areas, walls = wall_grid(steps)
    flux = np.array(ROOM_REFLECTANCES)[walls] * lamp_irradiance(light, sources, facing) * areas[:, None]
    result = []
    for point, normal in zip(points, normals, strict=True):
        towards = sources - point
        squared = (towards**2).sum(axis=1)
        received, emitted = np.maximum(towards @ normal, 0.0), np.maximum(-(towards * facing).sum(axis=1), 0.0)
        weight = np.divide(received * emitted, np.pi * squared**2, out=np.zeros_like(squared), where=squared > 0.0)
        result.append(weight @ flux)
    return np.array(result)


@pytest.mark.parametrize("name", LAMPS)
def test_mean_over_the_walls_is_the_one_bounce_reference_within_3_percent(device: Device, name: str) -> None:
    """Issue 5: 2,000 samples a map, unbiased, the disc covering the map."""
    points, normals, _ = wall_points(2048)
    found = gathered(device, empty_room([LAMPS[name]]), points, normals, 2000)[:, :3].mean(axis=0)
    np.testing.assert_allclose(found, reflected_power(LAMPS[name]) / room_area(), rtol=0.03)


def test_empty_room_of_one_reflectance_is_within_1_percent_of_its_closed_form(device: Device) -> None:
    points, normals, _ = wall_points(2048)
    found = gathered(device, empty_room([MIDDLE], ((0.5, 0.25, 0.75),)), points, normals, 2000)[:, :3].mean(axis=0)
    np.testing.assert_allclose(found, np.array([0.5, 0.25, 0.75]) * 45.0 / room_area(), rtol=0.01)


@pytest.mark.parametrize("name", ["point near the ceiling", "spot", "area"])
def test_points_away_from_corners_receive_what_the_sum_over_the_walls_says(device: Device, name: str) -> None:
    points, normals, _ = wall_points(COLUMNS, seed=3, margin=0.3)
    found = gathered(device, empty_room([LAMPS[name]]), points, normals, 8192)[:, :3]
    expected = one_bounce(LAMPS[name], points, normals)
    np.testing.assert_allclose(found, expected, rtol=0.08, atol=0.01 * expected.mean())
    assert np.abs(found / expected - 1.0).mean() < 0.02


def test_any_number_of_samples_estimates_the_same(device: Device) -> None:
    """With what the bound took off, few samples are right on average, too; without, they come to it from below."""
    points, normals, _ = wall_points(4096, seed=5)
    room = empty_room([MIDDLE], ((0.5, 0.5, 0.5),))
    expected = 0.5 * 45.0 / room_area()
    kept, whole = [], []
    for samples in (50, 200, 2000):
        found = gathered(device, room, points, normals, samples)
        kept.append(found[:, 0].mean() / expected)
        whole.append((found[:, 0] + found[:, 3]).mean() / expected)
    assert kept[0] < kept[1] < kept[2]
    assert kept == pytest.approx([0.86, 0.95, 0.995], abs=0.02)
    assert whole == pytest.approx([1.0, 1.0, 1.0], abs=0.03)


def test_squared_weight_loses_more_than_half_of_the_energy(device: Device) -> None:
    points, normals, _ = wall_points(2048)
    room = empty_room([MIDDLE])
    unbiased, squared = (
        gathered(device, room, points, normals, 2000, weight)[:, :3].mean() for weight in (UNBIASED, SQUARED)
    )
    assert 0.2 < squared / unbiased < 0.4


def test_smaller_discs_hold_less_and_never_more(device: Device) -> None:
    points, normals, _ = wall_points(1024)
    for lamp in ("point in the middle", "spot"):
        room = empty_room([LAMPS[lamp]])
        means = [gathered(device, room, points, normals, 1000, radius=r)[:, 0].mean() for r in (0.1, 0.3, 0.6, 1.0)]
        assert means == sorted(means)
        assert means[0] < 0.2 * means[-1]


def test_taps_are_weighted_so_that_a_disc_counts_evenly() -> None:
    """Mean of weight times f over taps is the mean of f over the disc: f = 1, x², and r."""
    taps = sample_taps(20_000, 0, UNBIASED).astype(float)
    radius = np.hypot(taps[:, 0], taps[:, 1])
    assert taps[:, 2].mean() == pytest.approx(1.0, abs=1e-3)
    assert (taps[:, 2] * taps[:, 0] ** 2).mean() == pytest.approx(0.25, abs=1e-3)
    assert (taps[:, 2] * radius).mean() == pytest.approx(2.0 / 3.0, abs=1e-3)
    assert sample_taps(20_000, 0, SQUARED)[:, 2].mean() == pytest.approx(1.0 / 3.0, abs=1e-3)
    assert (sample_taps(50, 3, UNBIASED) == sample_taps(200, 0, UNBIASED)[150:]).all()


@pytest.mark.parametrize("samples", [1, 2, 7, 50, 1000])
@pytest.mark.parametrize("name", ["point near the ceiling", "spot", "area"])
def test_nothing_is_brighter_than_the_brightest_surface(device: Device, name: str, samples: int) -> None:
    """Points in corners, at edges and 0.1 mm off the walls; the greatest radiosity is that below the lamp."""
    half = 0.5 * np.array(ROOM_SIZE)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    points = np.concatenate([corners * (half - gap) for gap in (0.0, 1e-4, 1e-2)] * 3)[:COLUMNS]
    normals = np.concatenate([-np.sign(points[:, k : k + 1]) * np.eye(3)[k] for k in range(3)])
    points = np.tile(points, (3, 1))
    light = LAMPS[name]
    sources, facing, _, walls = wall_grid(200)
    brightest = (np.array(ROOM_REFLECTANCES)[walls] * lamp_irradiance(light, sources, facing)).max(axis=0)
    found = gathered(device, empty_room([light]), points, normals, samples)
    assert np.isfinite(found).all()
    assert (found[:, :3] <= 1.02 * brightest).all()
    assert (found >= 0.0).all()


def test_light_switched_off_and_ten_lamps_and_none(device: Device) -> None:
    points, normals, _ = wall_points(256)
    lamps = [
        replace(MIDDLE, position=(0.3 * i - 1.5, 0.1 * i - 0.5, 0.05 * i), power=(i + 1.0,) * 3) for i in range(10)
    ]
    alone = [gathered(device, empty_room([lamp]), points, normals, 50)[:, :3] for lamp in lamps]
    together = gathered(device, empty_room(lamps), points, normals, 50)[:, :3]
    np.testing.assert_allclose(together, np.sum(alone, axis=0), rtol=1e-5)
    off = [replace(lamp, power=(0.0, 0.0, 0.0)) for lamp in lamps[1:]]
    assert (gathered(device, empty_room([lamps[0], *off]), points, normals, 50)[:, :3] == alone[0]).all()
    assert not gathered(device, empty_room(off), points, normals, 50).any()
    assert not gathered(device, empty_room([]), points, normals, 50).any()


def test_lamp_inside_a_wall_lights_nothing(device: Device) -> None:
    points, normals, _ = wall_points(256)
    room = empty_room([replace(MIDDLE, position=(0.7, 0.0, 0.0))])
    block = inward_box((0.6, -0.1, -0.1), (0.8, 0.1, 0.1), [0] * 6, outward=True)
    assert not gathered(device, replace(room, meshes=(*room.meshes, *block)), points, normals, 50).any()


def rendered(device: Device, snapshot: SceneSnapshot, pictures: int = 1, **settings: object) -> Frame:
    wanted = RenderSettings(32, 24, "rsm_gather", settings, pictures, 64, 4, buffers=True)
    return device.render(snapshot, None, wanted)


def test_maps_are_drawn_once_for_all_pictures_of_a_frame_and_counted(device: Device) -> None:
    frame = rendered(device, empty_room([MIDDLE, LAMPS["area"]]), 4, area_maps=3)
    assert frame.counters["reflective_maps"] == frame.counters["reflective_maps_drawn"] == 4
    assert 0.0 < frame.counters["bound_removes_share"] < 0.2
    assert {"reflective shadow maps", "gather"} <= {name for name, _ in frame.timings}


def test_more_pictures_leave_less_to_the_bound(device: Device) -> None:
    room = empty_room([MIDDLE])
    shares = [rendered(device, room, pictures, samples=50).counters["bound_removes_share"] for pictures in (1, 16)]
    assert shares[1] < 0.4 * shares[0]


def test_lamps_that_cast_no_shadow_are_named(device: Device) -> None:
    frame = rendered(device, empty_room([replace(MIDDLE, name="Ghost", casts_shadow=False), LAMPS["spot"]]))
    assert len(frame.reasons) == 1
    assert "Ghost" in frame.reasons[0]


def test_sun_bounces_off_the_floor_onto_a_wall(device: Device) -> None:
    """Irradiance at a wall's point from a sunlit floor: its form factor times reflectance x irradiance."""
    room = empty_room([], ((0.6, 0.6, 0.6),))
    sun = Light("l", SUN, (2.0, 2.0, 2.0), (0.0, 0.0, 0.0))
    floor = replace(room, meshes=(room.meshes[4],), lights=(sun,), camera=camera_at((0, 0, 5), (0, 0, 0)))
    points = np.tile([[2.0, 0.0, 0.0]], (COLUMNS, 1))
    normals = np.tile([[-1.0, 0.0, 0.0]], (COLUMNS, 1))
    found = gathered(device, floor, points, normals, 8192)[0, :3]
    sources, facing, areas, walls = wall_grid(400)
    lit = walls == 4
    towards = sources[lit] - points[0]
    squared = (towards**2).sum(axis=1)
    factor = (-towards[:, 0] * -(towards * facing[lit]).sum(axis=1) / (np.pi * squared**2) * areas[lit]).sum()
    np.testing.assert_allclose(found, 0.6 * 2.0 * factor, rtol=0.03)


def test_images_show_every_step(device: Device) -> None:
    """Of a frame with a cube's map and a tile's: places in the room, all of the flux, and where the pixel looked."""
    room = replace(empty_room([MIDDLE, LAMPS["spot"]]), name="moved")
    offset = np.array([7.0, -3.0, 2.0])
    moved = replace(
        room,
        meshes=tuple(replace(mesh, positions=mesh.positions + offset) for mesh in room.meshes),
        lights=tuple(
            replace(lamp, position=tuple((np.array(lamp.position) + offset).tolist())) for lamp in room.lights
        ),
        camera=camera_at(np.array((-1.8, -1.0, 0.55)) + offset, np.array((0.55, 0.45, -0.18)) + offset, lens=17.0),
    )
    frame = rendered(device, moved, low_resolution=1)
    images = {name.removeprefix("rsm_gather_"): image for name, image in frame.images.items() if "rsm_gather_" in name}
    assert images["map_0_position"].shape == (512, 768, 3)
    assert images["map_1_flux"].shape == (512, 512, 3)
    for index, lamp in enumerate(room.lights):
        shown = (images[f"map_{index}_normal"] != 0.0).any(axis=2)
        places = images[f"map_{index}_position"][shown] - offset
        on_wall = np.abs(np.abs(places) - 0.5 * np.array(ROOM_SIZE)).min(axis=1)
        assert on_wall.max() < 1e-4
        depth = images[f"map_{index}_depth"][..., 0][shown]
        distance = np.linalg.norm(places + offset - moved.lights[index].position, axis=1)
        assert ((depth > 0.0) & (depth <= distance * (1.0 + 1e-4))).all()
        found = images[f"map_{index}_flux"].sum(axis=(0, 1), dtype=float)
        np.testing.assert_allclose(found, reflected_power(lamp), rtol=0.01)
        looked = images[f"map_{index}_places"]
        assert set(np.unique(looked)) == {0.0, 1.0}
        assert 50 < looked.sum() <= 200
    share = images["bound_removes"].sum() / (images["bound_removes"].sum() + frame.images["irradiance"].mean(2).sum())
    assert share == pytest.approx(frame.counters["bound_removes_share"], rel=1e-3)
    assert images["discontinuity"].all()


def test_low_resolution_differs_little_and_its_images_show_where(device: Device) -> None:
    room = empty_room([MIDDLE])
    wanted = RenderSettings(96, 72, "rsm_gather", {"samples": 1000}, 1, 64, 4, buffers=True)
    frame = device.render(room, None, wanted)
    every = device.render(room, None, replace(wanted, technique_settings={"samples": 1000, "low_resolution": 1}))
    assert relative_rmse(frame.images["indirect"], every.images["indirect"]) < 0.02
    share = frame.counters["low_resolution_share"]
    assert share > 0.5
    assert frame.images["rsm_gather_discontinuity"].mean() == pytest.approx(1.0 - share, abs=0.02)
    low = frame.images["rsm_gather_low_resolution"]
    assert np.abs(low - every.images["irradiance"]).mean() < 0.1 * low.mean()
