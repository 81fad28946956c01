# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of the world on surfaces: closed forms, sums over its map, what must stay black, and the background."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, facing_camera, lights_from_triangles, quad
from vlm_addon.core.environment import map_directions, map_solid_angles, radiance_towards
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.scene import DIFFUSE, Environment, Material, Mesh, SceneSnapshot
from vlm_addon.core.world_light import world_lights
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.lamp_shadows import LampShadows
from vlm_addon.render.lit_lights import radiosity_of
from vlm_addon.render.passes.phase_one import PhaseOnePass
from vlm_addon.render.picture_shares import picture_shares
from vlm_addon.render.view import make_view

GREY = Material("grey", DIFFUSE, (0.5, 0.5, 0.5))
RADIANCE = (1.0, 2.0, 3.0)
FLOOR = quad((-50, -50, 0), (100, 0, 0), (0, 100, 0))
WALL = quad((0, -50, 0), (0, 100, 0), (0, 0, 100))
TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def settings(technique: str = "direct", size: tuple[int, int] = (16, 12), **values: object) -> RenderSettings:
    chosen = {"samples": 1, "shadow_resolution": 512, "shadow_samples": 1, **values}
    return RenderSettings(*size, technique, **chosen)  # type: ignore[arg-type]


def under_the_sky(*meshes: Mesh, **values: object) -> SceneSnapshot:
    chosen = {"camera": facing_camera(), "world_radiance": RADIANCE, **values}
    return SceneSnapshot("s", meshes, (GREY,), **chosen)  # type: ignore[arg-type]


def uneven_sky(height: int = 64, width: int = 128) -> np.ndarray:
    directions = map_directions(height, width)
    return (1.0 + directions + 4.0 * np.exp(-4.0 * (1.0 - directions @ (0.6, 0.0, 0.8))[..., None])).astype(np.float32)


def box(low: float, high: float) -> list[Mesh]:
    """The six sides of a cube, which face inwards."""
    corner, size, sides = np.full(3, low), high - low, []
    for axis in range(3):
        across, u, v = (size * np.eye(3)[(axis + i) % 3] for i in range(3))
        sides += [quad(corner, u, v), quad(corner + across, v, u)]
    return sides


@pytest.mark.parametrize(("samples", "error"), [(1, 0.02), (16, 0.006)])
def test_an_open_floor_reflects_the_sky(device: Device, samples: int, error: float) -> None:
    """Irradiance pi L, of which a diffuse surface sends out its colour times L."""
    images = device.render(under_the_sky(FLOOR), None, settings(samples=samples)).images
    wanted = np.broadcast_to(0.5 * np.array(RADIANCE), images["direct"].shape)
    assert images["direct"] == pytest.approx(wanted, rel=error)
    assert images["combined"][..., :3] == pytest.approx(images["direct"])


def test_a_floor_at_the_foot_of_a_wall_sees_half_of_the_sky(device: Device) -> None:
    scene = under_the_sky(FLOOR, WALL, camera=camera_at((1.0, 0.0, 2.0), (1.0, 0.0, 0.0), lens=400.0))
    row = device.render(scene, None, settings(samples=16)).images["direct"][6]
    assert row.mean(axis=0) == pytest.approx(0.25 * np.array(RADIANCE), rel=0.03)


def test_an_uneven_sky_beside_a_wall_is_the_sum_over_its_map(device: Device) -> None:
    environment = Environment("e", uneven_sky(), TURN)
    scene = under_the_sky(FLOOR, WALL, environment=environment, world_radiance=(0.0, 0.0, 0.0))
    scene = replace(scene, camera=camera_at((1.0, 0.0, 2.0), (1.0, 0.0, 0.0), lens=400.0))
    found = device.render(scene, None, settings(samples=16)).images["direct"].mean(axis=(0, 1))
    directions = map_directions(64, 128)
    sent = radiance_towards(environment, directions) * map_solid_angles(64, 128)[:, None, None]
    cosines = np.where(directions[..., 0] > 0.0, np.maximum(directions[..., 2], 0.0), 0.0)
    irradiance = (sent * cosines[..., None]).sum(axis=(0, 1))
    unoccluded = (sent * np.maximum(directions[..., 2:], 0.0)).sum(axis=(0, 1))
    assert np.all(np.abs(found * math.pi / 0.5 - irradiance) < 0.015 * unoccluded)


def test_a_room_with_walls_stays_black(device: Device) -> None:
    """But for a ten-thousandth of the sky's radiance in single pixels, where light grazes walls."""
    inside = camera_at((0.3, 0.4, 0.9), (-0.5, -0.5, -0.8), lens=15.0)
    scene = under_the_sky(*box(-1.0, 1.0), *box(-1.2, 1.2), camera=inside)
    found = device.render(scene, None, settings(size=(64, 48), samples=16, shadow_resolution=1024)).images["direct"]
    assert found.max() < 1e-4 * max(RADIANCE)
    assert found.mean() < 1e-6 * max(RADIANCE)


def test_surfaces_of_every_orientation_receive_what_the_lights_bring(device: Device) -> None:
    """Without occluders; the oracle is core's sum over the same lights."""
    environment = Environment("e", uneven_sky(), TURN)
    for turn in np.linspace(0.1, 3.0, 5):
        u, v = (0.0, 2.0, 0.0), (2.0 * math.cos(turn), 0.0, 2.0 * math.sin(turn))
        middle = -0.5 * (np.array(u) + np.array(v))
        normal = np.cross(u, v) / 4.0
        scene = under_the_sky(quad(middle, u, v), environment=environment, camera=camera_at(3.0 * normal, (0, 0, 0)))
        found = device.render(scene, None, settings(world_lights=32)).images["direct"][6, 8]
        lights = world_lights(RADIANCE, environment, 32)
        truth = sum(lamp_irradiance(light, np.zeros((1, 3)), normal[None]) for light in lights)[0]
        assert found == pytest.approx(0.5 / math.pi * truth, rel=1e-3)


def test_a_rough_metal_reflects_an_even_sky_as_its_colour(device: Device) -> None:
    """Each light stands for a cone, so its highlights make an even sum; what is missing, rough metals lose anyway."""
    metal = Material("metal", base_color=(1.0, 0.5, 0.25), metallic=1.0, roughness=0.5)
    scene = replace(under_the_sky(FLOOR, world_radiance=(1.0, 1.0, 1.0)), materials=(metal,))
    found = device.render(scene, None, settings(samples=16)).images["direct"]
    assert found[6, 8] == pytest.approx(metal.base_color, rel=0.12)
    assert np.ptp(found, axis=(0, 1)) == pytest.approx(0.0, abs=0.05)


HOUSES = {
    "open": ([FLOOR], math.pi),
    "beside a wall": ([FLOOR, WALL], 0.5 * math.pi),
    "in a room": ([*box(-1.0, 3.0), *box(-1.2, 3.2)], 0.0),
}


@pytest.mark.parametrize("house", list(HOUSES))
def test_phase_one_measures_the_sky_that_is_seen(device: Device, house: str) -> None:
    """Virtual lights just under the floor, their samples on it; shares of pi L."""
    meshes, irradiance = HOUSES[house]
    triangles = np.array([[0.5, 0.0, -0.01], [0.6, 0.0, -0.01], [0.5, 0.1, -0.01]]) + np.zeros((4, 1, 1))
    triangles[:, :, 0] += 0.3 * np.arange(4)[:, None]
    lights = lights_from_triangles(triangles, emission=0.0, colour=0.5)
    places = triangles.mean(axis=1) * (1.0, 1.0, 0.0) + (0.0, 0.0, -1.0 if house == "in a room" else 0.0)
    lights = replace(lights, samples=replace(lights.samples, positions=places))
    scene = under_the_sky(*meshes)
    scene = replace(scene, lights=world_lights(scene.world_radiance, None, 64))
    with device.current() as context:
        geometry = GpuGeometry(context, scene)
        shadows = LampShadows(context, device.shaders, geometry, scene.lights, 512)
        phase_one, lamps = PhaseOnePass(context, device.shaders), range(len(scene.lights))
        found = radiosity_of(lights, phase_one.render(lights, geometry.origin, shadows, lamps, 1))
    wanted = np.broadcast_to(0.5 * irradiance * np.array(RADIANCE), found.shape)
    assert found == pytest.approx(wanted, rel=0.04)


def test_the_background_is_looked_up_by_direction(device: Device) -> None:
    environment = Environment("e", uneven_sky(), TURN)
    camera = camera_at((0.0, 0.0, 0.0), (1.0, 2.0, 0.5), lens=15.0)
    scene = SceneSnapshot("s", camera=camera, environment=environment, world_radiance=(0.5, 0.25, 0.0))
    found = device.render(scene, None, settings(size=(32, 24))).images["combined"][::-1, :, :3]
    corner, right, up = make_view(camera, 32, 24, np.zeros(3)).rays
    x, y = np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5)
    directions = corner + x[..., None] * right + y[..., None] * up
    wanted = radiance_towards(environment, directions) + np.array([0.5, 0.25, 0.0])
    assert found == pytest.approx(wanted, rel=5e-3)


def test_an_orthographic_camera_looks_in_one_direction(device: Device) -> None:
    environment = Environment("e", uneven_sky(), TURN)
    scene = SceneSnapshot("s", camera=camera_at((0, 0, 0), (1, 2, 0.5), kind="ORTHOGRAPHIC"), environment=environment)
    found = device.render(scene, None, settings()).images["combined"][..., :3]
    wanted = radiance_towards(environment, np.array([1.0, 2.0, 0.5]))
    assert found == pytest.approx(np.broadcast_to(wanted, found.shape), rel=5e-3)


def test_a_black_world_changes_nothing(device: Device) -> None:
    room = box_room()
    black = Environment("e", np.zeros((4, 8, 3), np.float32), np.eye(3))
    without = device.render(room, None, settings(samples=4))
    frame = device.render(replace(room, environment=black), None, settings(samples=4))
    assert [name for name, _ in frame.timings] == [name for name, _ in without.timings]
    assert frame.counters == without.counters
    for name, image in without.images.items():
        np.testing.assert_array_equal(frame.images[name], image)


def test_the_frame_says_how_many_lights_stand_for_the_world(device: Device) -> None:
    counters = device.render(under_the_sky(FLOOR), None, settings(samples=16, world_lights=20)).counters
    assert (counters["lights"], counters["world_lights"], counters["world_lights_direct"]) == (0, 20, 80)


def test_a_world_that_means_nothing_is_refused(device: Device) -> None:
    with pytest.raises(InvalidInput, match="world: its radiance is"):
        device.render(under_the_sky(FLOOR, world_radiance=(math.nan, 0.0, 0.0)), None, settings())


def test_lights_of_the_world_are_kept_over_frames(device: Device) -> None:
    scene = under_the_sky(FLOOR, world_radiance=(0.125, 0.5, 0.75))
    first = device.render(scene, None, settings()).images["direct"]
    kinds = ("world_lights", "direct_world_lights")
    built = [device.kept.built[kind] for kind in kinds]
    second = device.render(replace(scene, camera=facing_camera(2.5)), None, settings()).images["direct"]
    assert [device.kept.built[kind] for kind in kinds] == built
    assert second == pytest.approx(first, rel=1e-3)


@pytest.mark.parametrize("pictures", [1, 2, 3, 4, 6, 16, 50])
def test_over_the_pictures_every_light_counts_once(pictures: int) -> None:
    lights = (*box_room().lights, *world_lights(RADIANCE, Environment("e", uneven_sky(), TURN), 200))
    shares = picture_shares(lights, pictures)
    assert shares.mean(axis=0) == pytest.approx(1.0)
    assert (shares[:, 0] == 1.0).all()


def test_each_picture_has_a_share_of_the_lights_from_everywhere() -> None:
    lights = world_lights((1.0, 1.0, 1.0), None, 256)
    shares = picture_shares(lights, 16)
    axes, power = np.array([light.z_axis for light in lights]), np.array([light.power[0] for light in lights])
    assert np.count_nonzero(shares, axis=1).max() <= 32
    assert (shares @ power) == pytest.approx(power.sum(), rel=0.2)
    assert np.linalg.norm(shares @ (power[:, None] * axes), axis=1).max() < 0.2 * power.sum()


def test_a_light_that_brings_much_is_in_every_picture() -> None:
    sky = uneven_sky()
    sky[50, 20] = 1e5
    lights = world_lights((0.0, 0.0, 0.0), Environment("e", sky, TURN), 256)
    brightest = int(np.argmax([light.power[0] for light in lights]))
    assert (picture_shares(lights, 16)[:, brightest] == 1.0).all()
