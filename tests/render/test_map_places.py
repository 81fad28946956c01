# SPDX-License-Identifier: GPL-3.0-or-later
"""Places in reflective shadow maps: what the texels show lies where they say, and together they are all of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, room_area
from tests.render.test_rsm_gather import LAMPS, WATTS, reflected_power
from vlm_addon.core.scene import SPOT, SUN, Light
from vlm_addon.core.vpl import VirtualPointLights
from vlm_addon.render.device import Device
from vlm_addon.render.indirect_lights import IndirectLights
from vlm_addon.render.kept import Kept
from vlm_addon.render.passes.rsm import LampReflections

SQUASHED = Light("l", SPOT, WATTS, (0.5, 0.2, 0.9), spot_angle=1.2, spot_blend=0.3, spot_scale=(1.5, 0.4))
NARROW = Light("l", SPOT, WATTS, (0.5, 0.2, 0.9), spot_angle=0.05, spot_blend=0.3)
LIGHTS = {**LAMPS, "squashed spot": SQUASHED, "narrow spot": NARROW}


def placed(device: Device, lamps: list[Light], count: int, pictures: int = 1) -> list[VirtualPointLights]:
    with device.current() as context:
        maps = LampReflections(context, device.shaders, Kept(), empty_room(lamps), 128, 4)
        return IndirectLights(context, device.shaders, maps).take(count, pictures)


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_send_out_what_the_walls_reflect_of_the_lamp(device: Device, name: str) -> None:
    (lights,) = placed(device, [LIGHTS[name]], 1000)
    assert len(lights.areas) >= 990
    exact = reflected_power(LIGHTS[name]) if name != "narrow spot" else None
    flux = lights.flux.sum(axis=0)
    if exact is not None:
        np.testing.assert_allclose(flux, exact, rtol=0.02)
        assert flux.mean() == pytest.approx(exact.mean(), rel=5e-3)
    else:
        # The cone holds little of the sphere: 45 W / 4 pi times about its solid angle and the floor's reflectance.
        assert 0.0 < flux.mean() < 45.0 * 0.5 * (1.0 - np.cos(0.025))


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_lie_on_walls_that_the_lamp_lights_and_face_the_room(device: Device, name: str) -> None:
    (lights,) = placed(device, [LIGHTS[name]], 300)
    size = np.array([4.0, 3.0, 2.5])
    off_wall = np.abs(np.abs(lights.positions) - 0.5 * size)
    axis = off_wall.argmin(axis=1)
    rows = np.arange(len(axis))
    assert off_wall[rows, axis].max() < 1e-4
    facing = np.zeros((len(axis), 3))
    facing[rows, axis] = -np.sign(lights.positions[rows, axis])
    np.testing.assert_allclose(lights.normals, facing, atol=1e-5)
    assert (np.abs(lights.positions) < 0.5 * size + 1e-4).all()


def test_lights_of_a_lamp_in_the_middle_cover_the_walls_evenly_for_it(device: Device) -> None:
    (lights,) = placed(device, [LIGHTS["point in the middle"]], 2000)
    assert lights.areas.sum() == pytest.approx(room_area(), rel=0.01)
    directions = lights.positions / np.linalg.norm(lights.positions, axis=1, keepdims=True)
    np.testing.assert_allclose(directions.mean(axis=0), 0.0, atol=0.01)
    np.testing.assert_allclose(directions.T @ directions / len(directions), np.eye(3) / 3.0, atol=0.01)


def test_a_sun_puts_its_lights_evenly_on_the_floor_it_sees(device: Device) -> None:
    """Into a room without a ceiling, from straight above: the floor reflects all of it."""
    room = empty_room([Light("l", SUN, (2.0, 2.0, 2.0), (0.0, 0.0, 0.0))])
    with device.current() as context:
        open_room = replace(room, meshes=room.meshes[4:5])
        maps = LampReflections(context, device.shaders, Kept(), open_room, 256, 4)
        (lights,) = IndirectLights(context, device.shaders, maps).take(500)
    np.testing.assert_allclose(lights.flux.sum(axis=0), 2.0 * 12.0 * np.array([0.45, 0.38, 0.30]), rtol=5e-3)
    np.testing.assert_allclose(lights.positions.mean(axis=0), [0.0, 0.0, -1.25], atol=0.02)
    assert lights.areas.sum() == pytest.approx(12.0, rel=0.02)


def test_lamps_share_the_lights_by_what_is_reflected_of_them(device: Device) -> None:
    dim = Light("l", "POINT", (5.0, 5.0, 5.0), (-1.0, 0.5, 0.2))
    (lights,) = placed(device, [LIGHTS["point in the middle"], dim], 1000)
    strong = lights.flux.mean(axis=1)
    assert len(lights.areas) == 1000
    np.testing.assert_allclose(strong.std() / strong.mean(), 0.35, atol=0.35)
    total = reflected_power(LIGHTS["point in the middle"]) + reflected_power(dim)
    np.testing.assert_allclose(lights.flux.sum(axis=0), total, rtol=0.02)


def test_every_picture_has_other_lights_that_stand_for_their_part_of_the_surface(device: Device) -> None:
    runs = placed(device, [LIGHTS["point in the middle"]], 100, pictures=4)
    assert not (runs[0].positions == runs[1].positions).all(axis=1).any()
    areas = np.concatenate([run.areas for run in runs])
    assert areas.sum() == pytest.approx(room_area(), rel=0.03)
    for run in runs:
        assert run.flux.sum(axis=0).mean() == pytest.approx(runs[0].flux.sum(axis=0).mean(), rel=1e-5)


def test_fewer_lights_than_lamps_send_out_the_light_of_all(device: Device) -> None:
    lamps = [Light("l", "POINT", (i + 1.0,) * 3, (0.3 * i - 1.5, 0.1 * i - 0.5, 0.05 * i)) for i in range(10)]
    (lights,) = placed(device, lamps, 3)
    assert len(lights.areas) == 3
    assert lights.flux.mean(axis=1).sum() == pytest.approx(
        sum(reflected_power(lamp).mean() for lamp in lamps), rel=0.01
    )


@pytest.mark.parametrize("count", [0, 1])
def test_no_lights_and_one(device: Device, count: int) -> None:
    (lights,) = placed(device, [LIGHTS["spot"]], count)
    assert len(lights.areas) == count
    assert not len(placed(device, [], 100)[0].areas)
