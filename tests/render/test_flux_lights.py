# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights placed by the flux of reflective shadow maps: where the oracle says, of all the flux, without bias."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from tests.render.closed_rooms import ROOM_REFLECTANCES, ROOM_SIZE, empty_room, room_area, wall_points
from tests.render.flux_lights import RESOLUTION, WORLD, MapTexels, all_texels, as_lights, map_texels, placed
from tests.render.rooms import box_room, quad
from vlm_addon.core.flux_warp import choose_parts, importance_pyramid, warp_points
from vlm_addon.core.halton import halton_points
from vlm_addon.core.mesh_topology import Int64
from vlm_addon.core.scene import AREA, DIFFUSE, POINT, SPOT, SUN, Float64, Light, Material, SceneSnapshot
from vlm_addon.core.vpl import vpl_irradiance
from vlm_addon.core.world_light import world_lights
from vlm_addon.render.device import Device
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes import rsm
from vlm_addon.render.passes.flux_lights import FluxLightPass, parts_of_unit
from vlm_addon.render.passes.rsm import LampReflections

POINT_LAMP = Light("point", POINT, (45.0, 30.0, 20.0), (0.7, -0.4, 0.5))
SPOT_LAMP = Light("spot", SPOT, (10.0, 20.0, 30.0), (0.5, 0.2, 0.9), spot_angle=1.5, spot_blend=0.3)
AREA_LAMP = Light("area", AREA, (20.0, 20.0, 20.0), (0.0, 0.0, 1.2), size_x=1.0, size_y=0.8)
FAINT_LAMP = replace(SPOT_LAMP, name="faint", power=(0.002, 0.002, 0.002), position=(-1.0, 0.2, 0.5))
SUN_LAMP = Light("sun", SUN, (2.0, 1.9, 1.5), (0.0, 0.0, 0.0), x_axis=(0.8, 0.0, -0.6), z_axis=(0.6, 0.0, 0.8))
SCENES = {
    "point": empty_room([POINT_LAMP]),
    "four lamps": empty_room([SPOT_LAMP, AREA_LAMP, FAINT_LAMP, POINT_LAMP]),
    "sun and world": replace(
        box_room(), lights=(SUN_LAMP, *world_lights((0.5, 0.6, 0.8), None, 16)), world_radiance=(0.0, 0.0, 0.0)
    ),
}
SHIFTS = [tuple(shift) for shift in np.random.default_rng(7).random((16, 2)).tolist()]


def powers(maps: list[MapTexels]) -> Float64:
    """(m,) W, mean of the channels."""
    return np.array([found.flux.mean(axis=2).sum() for found in maps])


def oracle_texels(maps: list[MapTexels], points: Float64) -> Int64:
    """(n, 3): number of the map that each point chooses, column and row in it."""
    chosen = choose_parts(powers(maps), points[:, 0])
    texels = np.zeros((len(points), 3), int)
    for index, found in enumerate(maps):
        mine = chosen.parts == index
        if mine.any():
            pyramid = importance_pyramid(found.flux.sum(axis=2), found.side.bit_length())
            warped = warp_points(pyramid, np.stack([chosen.stretched[mine], points[mine, 1]], axis=1))
            texels[mine] = np.column_stack([np.full(mine.sum(), index), warped.texels])
    return texels


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.37, 0.81)])
@pytest.mark.parametrize("name", SCENES)
def test_lights_are_in_the_texels_of_the_oracle(device: Device, name: str, shift: tuple[float, float]) -> None:
    """All but those whose point lies within float32's digits of a border between texels."""
    count, first = 4000, 321
    (records,) = placed(device, SCENES[name], count, first, [shift])
    maps = map_texels(device, SCENES[name])
    texels = oracle_texels(maps, (halton_points(count, first) + shift) % 1.0)
    rows = [(maps[index], row, column) for index, column, row in texels]
    expected = {
        "position": np.array([found.positions[row, column] for found, row, column in rows]),
        "normal": np.array([found.normals[row, column] for found, row, column in rows]),
        "geometric_normal": np.array([found.geometric_normals[row, column] for found, row, column in rows]),
    }
    flux = np.array([found.flux[row, column] for found, row, column in rows])
    expected["flux"] = flux / flux.mean(axis=1, keepdims=True) * powers(maps).sum() / count
    same = np.isclose(records["position"], expected["position"], atol=1e-5).all(axis=1)
    assert same.mean() > 0.99
    for field, values in expected.items():
        np.testing.assert_allclose(records[field][same], values[same], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("count", [1, 7, 1000])
@pytest.mark.parametrize("name", SCENES)
def test_all_lights_have_the_same_flux_and_together_all_of_it(device: Device, name: str, count: int) -> None:
    (records,) = placed(device, SCENES[name], count)
    found = records["flux"].astype(float).mean(axis=1)
    np.testing.assert_allclose(found, powers(map_texels(device, SCENES[name])).sum() / count, rtol=1e-5)


@cache
def exact_and_estimated(device: Device, name: str, count: int) -> tuple[Float64, Float64]:
    """Irradiance at 30 points from all texels, (30, 3), and for each of SHIFTS from `count` lights, (16, 30, 3)."""
    scene = SCENES[name]
    if name == "sun and world":
        floor = np.random.default_rng(3).uniform((0.2, 0.2), (1.8, 1.8), (30, 2))
        points, normals = np.column_stack([floor, np.full(30, 1.2)]), np.tile([0.0, 0.6, -0.8], (30, 1))
    else:
        points, normals, _ = wall_points(30, seed=3, margin=0.5)
    exact = vpl_irradiance(points, normals, all_texels(map_texels(device, scene))).irradiance
    found = placed(device, scene, count, shifts=SHIFTS)
    return exact, np.array([vpl_irradiance(points, normals, as_lights(records)).irradiance for records in found])


@pytest.mark.parametrize("count", [100, 1000])
@pytest.mark.parametrize("name", SCENES)
def test_mean_over_shifts_is_what_all_texels_bring(device: Device, name: str, count: int) -> None:
    """Within what the spread of the shifts allows, and within 2 % of the mean for 1,000 lights."""
    exact, found = exact_and_estimated(device, name, count)
    error = found.mean(axis=0) - exact
    standard = found.std(axis=0, ddof=1) / np.sqrt(len(SHIFTS))
    assert np.sqrt((error**2).mean() / (standard**2).mean()) < 1.5
    if count == 1000:
        assert np.sqrt((error**2).mean()) < 0.02 * exact.mean()


@pytest.mark.parametrize("name", SCENES)
def test_errors_fall_faster_than_those_of_random_points(device: Device, name: str) -> None:
    errors = []
    for count in (100, 1000):
        exact, found = exact_and_estimated(device, name, count)
        errors.append(np.sqrt(((found - exact) ** 2).mean()) / exact.mean())
    assert errors[1] < errors[0] / np.sqrt(10.0)


def test_a_run_of_lights_is_as_good_as_so_many_lights_alone(device: Device) -> None:
    """Interleaved sampling gives each tile one of 16 runs."""
    exact, alone = exact_and_estimated(device, "four lamps", 100)
    points, normals, _ = wall_points(30, seed=3, margin=0.5)
    (records,) = placed(device, SCENES["four lamps"], 1600)
    runs = [vpl_irradiance(points, normals, as_lights(run)).irradiance for run in np.split(records, 16)]
    errors = [np.sqrt(((16.0 * np.array(runs) - exact) ** 2).mean()), np.sqrt(((alone - exact) ** 2).mean())]
    assert errors[0] < 1.2 * errors[1]


def test_a_faint_lamp_has_as_many_lights_as_its_power_in_the_mean_over_pictures(device: Device) -> None:
    """64 lights moved around in 200 equal steps are an even grid of 12,800 first coordinates."""
    steps, count = 200, 64
    shifts = [(step / (steps * count), 0.0) for step in range(steps)]
    strong, faint = (replace(lamp, power=power) for lamp, power in ((SPOT_LAMP, (1.0,) * 3), (FAINT_LAMP, (1e-3,) * 3)))
    red = replace(faint, power=(1e-3, 0.0, 0.0))
    scene = empty_room([strong, red], ((0.5, 0.5, 0.5),))
    found = np.concatenate(placed(device, scene, count, first=0, shifts=shifts))
    share = powers(map_texels(device, scene))
    of_red = int((found["flux"][:, 1] == 0.0).sum())
    assert of_red == pytest.approx(steps * count * share[1] / share.sum(), abs=1.0)
    assert of_red > 0


BLACK = {
    "no lamp": empty_room([]),
    "black walls": empty_room([POINT_LAMP], ((0.0, 0.0, 0.0),)),
    "lamp without power": empty_room([replace(POINT_LAMP, power=(0.0, 0.0, 0.0))]),
    "nothing to light": SceneSnapshot("s", (), (), lights=(POINT_LAMP,)),
    "back of a wall": SceneSnapshot(
        "s", (quad((-1, -1, 0), (0, 2, 0), (2, 0, 0)),), (Material("m", DIFFUSE, (0.8, 0.8, 0.8)),), lights=(SUN_LAMP,)
    ),
}


@pytest.mark.parametrize("name", BLACK)
def test_where_nothing_is_lit_all_lights_are_black(device: Device, name: str) -> None:
    (records,) = placed(device, BLACK[name], 50)
    assert len(records) == 50
    assert all(not records[field].any() for field in records.dtype.names)


def test_no_light_is_placed_for_a_count_of_0(device: Device) -> None:
    (records,) = placed(device, SCENES["point"], 0)
    assert len(records) == 0


def test_black_walls_beside_bright_ones_get_no_light(device: Device) -> None:
    """Two walls of six reflect, one of them in a single channel."""
    reflectances = [(0.0, 0.0, 0.0)] * 6
    reflectances[1], reflectances[4] = (0.0, 0.9, 0.0), (0.5, 0.5, 0.5)
    for records in placed(device, empty_room([POINT_LAMP], reflectances), 2000, shifts=[(0.0, 0.0), *SHIFTS[:3]]):
        x, z = records["position"][:, 0], records["position"][:, 2]
        assert (np.isclose(x, 2.0, atol=1e-4) | np.isclose(z, -1.25, atol=1e-4)).all()
        assert (records["flux"].max(axis=1) > 0.0).all()


@pytest.mark.parametrize("lamp", [POINT_LAMP, AREA_LAMP], ids=["point", "area"])
def test_pieces_of_surface_fill_what_is_lit(device: Device, lamp: Light) -> None:
    """Once, however many maps of an area lamp show it; 1,500 lights in maps of many more texels."""
    lit = room_area() - (0.0 if lamp is POINT_LAMP else 12.0 + 0.05 * 2.0 * 7.0)
    found = [records["area"].sum() for records in placed(device, empty_room([lamp]), 1500, shifts=SHIFTS)]
    assert np.mean(found) == pytest.approx(lit, rel=0.03)


def test_no_light_stands_for_less_than_its_texel(device: Device) -> None:
    scene = empty_room([POINT_LAMP])
    (records,) = placed(device, scene, 20_000, resolution=8)
    (found,) = map_texels(device, scene, resolution=8)
    assert records["area"].min() >= found.areas[found.areas > 0.0].min() * (1.0 - 1e-5)
    crowded = found.areas * np.maximum(powers([found]).sum() / 20_000 / found.flux.mean(axis=2), 1.0)
    assert np.isin(records["area"].round(5), crowded.astype(np.float32).round(5)).mean() > 0.99


def test_units_are_those_of_the_space(device: Device) -> None:
    space = LocalSpace(np.array([3.0, -2.0, 1.0]), 0.01)
    (world,), (local,) = (placed(device, SCENES["four lamps"], 500, space=chosen) for chosen in (WORLD, space))
    np.testing.assert_allclose(space.world_points(local["position"].astype(float)), world["position"], atol=1e-5)
    np.testing.assert_allclose(local["flux"] * 0.01**2, world["flux"], rtol=1e-5)
    np.testing.assert_allclose(local["area"] * 0.01**2, world["area"], rtol=1e-4)
    np.testing.assert_array_equal(local["normal"], world["normal"])


def test_the_triangles_own_normal_is_given_beside_the_shading_normal(device: Device) -> None:
    floor = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    tilted = np.broadcast_to(np.array([0.6, 0.0, 0.8], np.float32), (2, 3, 3)).copy()
    scene = SceneSnapshot(
        "s", (replace(floor, corner_normals=tilted),), (Material("m", DIFFUSE, (0.5, 0.5, 0.5)),), lights=(SUN_LAMP,)
    )
    (records,) = placed(device, scene, 20)
    np.testing.assert_allclose(records["normal"], np.tile([0.6, 0.0, 0.8], (20, 1)), atol=1e-6)
    np.testing.assert_allclose(records["geometric_normal"], np.tile([0.0, 0.0, 1.0], (20, 1)), atol=1e-6)


def test_the_flux_of_maps_is_read_once_while_they_stay_as_they_are(device: Device) -> None:
    with device.current() as context:
        lights = FluxLightPass(context, device.shaders)
        built = []
        for lamp in (POINT_LAMP, POINT_LAMP, SPOT_LAMP):
            maps = LampReflections(context, device.shaders, device.kept, empty_room([lamp]), RESOLUTION, 4)
            found = lights.render(maps, WORLD, 10, 1, (0.0, 0.0)).records()["flux"].sum(axis=0)
            built.append(device.kept.built["map_fluxes"])
            np.testing.assert_allclose(found.mean(), maps.fluxes().powers.sum(), rtol=1e-5)
    assert [count - built[0] for count in built] == [0, 0, 1]


def test_maps_that_are_not_kept_give_the_same_lights(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    (kept,) = placed(device, SCENES["four lamps"], 300)
    monkeypatch.setattr(rsm, "CACHE_BYTES", 0)
    (drawn,) = placed(device, SCENES["four lamps"], 300)
    assert all((kept[field] == drawn[field]).all() for field in kept.dtype.names)


def test_the_same_call_gives_the_same_bits(device: Device) -> None:
    first, second = placed(device, SCENES["four lamps"], 300, shifts=[SHIFTS[0]] * 2)
    assert all((first[field] == second[field]).all() for field in first.dtype.names)


def test_light_is_that_of_the_walls_colours(device: Device) -> None:
    """Each channel of the sum, though lights are placed by the mean of them."""
    exact = np.sum([found.flux.sum(axis=(0, 1)) for found in map_texels(device, SCENES["point"])], axis=0)
    found = np.mean([records["flux"].sum(axis=0) for records in placed(device, SCENES["point"], 500, shifts=SHIFTS)], 0)
    assert np.ptp(ROOM_REFLECTANCES, axis=0).max() > 0.1
    np.testing.assert_allclose(found, exact, rtol=5e-3)


@pytest.mark.parametrize("weights", [[1.0], [0.0, 1.0, 0.0], [1e-30, 1.0, 1e-30], [3.0, 0.0, 1.0, 0.0, 0.0]])
def test_parts_of_maps_leave_nothing_out_and_those_of_no_power_are_empty(weights: list[float]) -> None:
    ends = parts_of_unit(np.array(weights))
    assert ends[0] == 0.0
    assert ends[-1] == 1.0
    sizes = np.diff(ends)
    assert (sizes >= 0.0).all()
    assert (sizes[np.array(weights) == 0.0] == 0.0).all()
    np.testing.assert_allclose(sizes, np.array(weights) / np.sum(weights), atol=1e-7)


ROOM_LAMPS = st.builds(
    lambda kind, power, place, angle: Light(
        "l", kind, (power, 0.5 * power, 0.1 * power), place, spot_angle=angle, size_x=0.3, size_y=0.2
    ),
    st.sampled_from([POINT, SPOT, AREA]),
    st.floats(1e-9, 1e9),
    st.tuples(*(st.floats(-0.45 * side, 0.45 * side) for side in ROOM_SIZE)),
    st.floats(0.02, 3.0),
)


@hypothesis_settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(ROOM_LAMPS, min_size=1, max_size=3), st.integers(1, 3000), st.integers(1, 10**7))
def test_any_lamps_of_any_power_give_all_their_light(
    device: Device, lamps: list[Light], count: int, first: int
) -> None:
    scene = empty_room(lamps)
    (records,) = placed(device, scene, count, first, [(0.0, 0.0)], resolution=16)
    maps = map_texels(device, scene, resolution=16)
    np.testing.assert_allclose(records["flux"].mean(axis=1), powers(maps).sum() / count, rtol=1e-4)
    on_walls = np.abs(np.abs(records["position"]) - 0.5 * np.array(ROOM_SIZE)).min(axis=1)
    assert on_walls.max() < 1e-3
    assert (records["area"] > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(records["normal"], axis=1), 1.0, atol=1e-4)
