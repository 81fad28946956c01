# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights that stand for a world: their power, their irradiance against the integral over the sphere, odd worlds."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vlm_addon.core.array_codec import flatten, unflatten
from vlm_addon.core.environment import map_directions, map_solid_angles
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.scene import POINT, SUN, Environment, Light, SceneSnapshot
from vlm_addon.core.scene_codec import snapshot_from_tree
from vlm_addon.core.world_light import is_lit_by_world, merged_world_lights, world_lights

BLACK = (0.0, 0.0, 0.0)
UNTURNED = np.eye(3)
TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def normals(count: int = 200) -> np.ndarray:
    """Spread over the sphere (a Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * index / count, math.pi * (1.0 + math.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=-1)


def sky(height: int = 64, width: int = 128) -> np.ndarray:
    """Blue above, brown below, a sun of 1.5 degrees with about half of all light."""
    directions = map_directions(height, width)
    above = np.clip(directions[..., 2:], 0.0, 1.0)
    even = np.where(directions[..., 2:] > 0.0, (0.2, 0.4, 0.9) * (0.4 + 0.6 * above), (0.2, 0.15, 0.1))
    towards_sun = directions @ np.array([0.48, -0.6, 0.64])
    return (even + np.where(towards_sun > math.cos(0.026), 800.0, 0.0)[..., None] * (1.0, 0.9, 0.7)).astype(np.float32)


def lamps_of_a_room(height: int = 64, width: int = 128) -> np.ndarray:
    """A dim room with some bright windows."""
    generator = np.random.default_rng(1)
    radiance = np.full((height, width, 3), 0.1)
    for _ in range(5):
        row, column = generator.integers(8, height - 16), generator.integers(0, width - 10)
        radiance[row : row + 5, column : column + 9] = generator.uniform(5.0, 60.0, 3)
    return radiance.astype(np.float32)


def integral(radiance: np.ndarray) -> np.ndarray:
    """(3,) of a map over the sphere: what it sends through a point, W/m²."""
    return map_solid_angles(*radiance.shape[:2]) @ radiance.sum(axis=1, dtype=np.float64)


def irradiance(radiance: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """(n, 3) on surfaces that face `facing`, by the sum over all texels."""
    height, width = radiance.shape[:2]
    cosines = np.maximum(facing @ map_directions(height, width).reshape(-1, 3).T, 0.0)
    return cosines @ (radiance * map_solid_angles(height, width)[:, None, None]).reshape(-1, 3)


def from_lights(lights: tuple[Light, ...], facing: np.ndarray) -> np.ndarray:
    return sum(lamp_irradiance(light, np.zeros_like(facing), facing) for light in lights)


def total(lights: tuple[Light, ...]) -> np.ndarray:
    return np.sum([light.power for light in lights], axis=0)


MAPS = {"sky": sky(), "room": lamps_of_a_room(), "even": np.ones((64, 128, 3), np.float32)}


@pytest.mark.parametrize("count", [1, 2, 7, 64, 300])
@pytest.mark.parametrize("name", list(MAPS))
def test_no_light_is_lost_and_none_is_added(name: str, count: int) -> None:
    lights = world_lights((0.3, 0.0, 2.0), Environment("e", MAPS[name], TURN), count)
    assert 0 < len(lights) <= count
    assert total(lights) == pytest.approx(integral(MAPS[name]) + 4.0 * math.pi * np.array([0.3, 0.0, 2.0]), rel=1e-9)


@settings(deadline=None, max_examples=12)
@given(st.integers(1, 24), st.integers(1, 48), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_random_worlds_keep_their_light(height: int, width: int, count: int, seed: int) -> None:
    """Texels of any contrast, many of them black; those smaller than the cells, so that nothing is between them."""
    generator = np.random.default_rng(seed)
    small = np.where(
        generator.random((height, width, 3)) < 0.5, 0.0, 10.0 ** generator.uniform(-20, 20, (height, width, 3))
    )
    radiance = np.repeat(np.repeat(small, -(-64 // height), axis=0), -(-128 // width), axis=1).astype(np.float32)
    lights = world_lights(BLACK, Environment("e", radiance, TURN), count)
    assert total(lights) == pytest.approx(integral(radiance), rel=1e-9) if lights else not radiance.any()
    axes = np.array([light.z_axis for light in lights]).reshape(-1, 3)
    assert np.linalg.norm(axes, axis=1) == pytest.approx(1.0)
    assert all(0.0 <= light.angle <= math.pi + 1e-12 for light in lights)
    assert all(min(light.power) >= 0.0 for light in lights)


@pytest.mark.parametrize(
    ("count", "mean_error", "largest"), [(16, 0.03, 0.09), (64, 0.006, 0.016), (256, 0.0015, 0.004)]
)
@pytest.mark.parametrize("name", list(MAPS))
def test_irradiance_is_that_of_the_world(name: str, count: int, mean_error: float, largest: float) -> None:
    """Of surfaces with nothing around them; shares of the mean over all orientations."""
    facing = normals()
    truth = irradiance(MAPS[name], facing)
    lights = world_lights(BLACK, Environment("e", MAPS[name], UNTURNED), count)
    errors = np.abs(from_lights(lights, facing) - truth) / truth.mean(axis=0)
    assert np.sqrt(np.mean(errors**2)) < mean_error
    assert errors.max() < largest


def test_half_of_the_sky_is_half_of_the_light() -> None:
    """Beside a wall: of lights on its one side, a floor receives half of pi times the radiance."""
    up = np.array([[0.0, 0.0, 1.0]])
    lights = tuple(light for light in world_lights((1.0, 1.0, 1.0), None, 256) if light.z_axis[0] > 0.0)
    assert from_lights(lights, up)[0] == pytest.approx(0.5 * math.pi, rel=0.02)


def test_a_turned_map_turns_its_light() -> None:
    facing = normals()
    lights = world_lights(BLACK, Environment("e", sky(), TURN), 256)
    assert from_lights(lights, facing) == pytest.approx(irradiance(sky(), facing @ TURN.T), rel=0.02)


def test_a_sun_in_the_map_is_small_lights_within_it() -> None:
    lights = world_lights(BLACK, Environment("e", sky(256, 512), UNTURNED), 64)
    inside = [light for light in lights if np.dot(light.z_axis, (0.48, -0.6, 0.64)) > math.cos(math.radians(1.7))]
    assert 1 <= len(inside) <= 6
    assert max(math.degrees(light.angle) for light in inside) < 10.0
    assert sum(light.power[0] for light in inside) > 0.4 * total(lights)[0]


def test_a_light_of_one_texel_points_at_it() -> None:
    radiance = np.zeros((128, 256, 3), np.float32)
    radiance[100, 30] = (1.0, 2.0, 3.0)
    (light,) = world_lights(BLACK, Environment("e", radiance, UNTURNED), 64)
    assert light.z_axis == pytest.approx(map_directions(128, 256)[100, 30])
    assert light.power == pytest.approx(np.array([1.0, 2.0, 3.0]) * map_solid_angles(128, 256)[100])
    assert light.kind == SUN
    assert light.from_world


def test_an_even_world_has_even_lights() -> None:
    """Each of 64 stands for about 1/64 of the sphere, a cone of 29 degrees."""
    lights = world_lights((2.0, 2.0, 2.0), None, 64)
    assert len(lights) == 64
    angles = np.degrees([light.angle for light in lights])
    assert angles.min() > 25.0
    assert angles.max() < 33.0
    powers = np.array([light.power[0] for light in lights])
    assert powers.max() < 1.5 * powers.min()


def test_axes_are_a_right_handed_frame() -> None:
    for light in world_lights((1.0, 1.0, 1.0), None, 16):
        frame = np.array([light.x_axis, light.y_axis, light.z_axis])
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)


def test_neighbours_in_the_list_are_near_each_other() -> None:
    axes = np.array([light.z_axis for light in world_lights((1.0, 1.0, 1.0), None, 64)])
    groups = axes.reshape(8, 8, 3)
    assert np.linalg.norm(groups.mean(axis=1), axis=1).min() > 0.6


def test_merged_lights_bring_the_same_light() -> None:
    facing, lamp = normals(), Light("lamp", POINT, (1.0, 1.0, 1.0), BLACK)
    lights = world_lights(BLACK, Environment("e", sky(), TURN), 64)
    found = merged_world_lights((lamp, *lights), 16)
    assert found[0] is lamp
    assert len(found) == 17
    assert total(found[1:]) == pytest.approx(total(lights))
    truth = from_lights(lights, facing)
    errors = np.abs(from_lights(found[1:], facing) - truth) / truth.mean(axis=0)
    assert np.sqrt(np.mean(errors**2)) < 0.08
    assert merged_world_lights(found, 16) == found


@pytest.mark.parametrize("environment", [None, Environment("e", np.zeros((4, 8, 3), np.float32), UNTURNED)])
def test_a_black_world_has_no_lights(environment: Environment | None) -> None:
    assert world_lights(BLACK, environment, 64) == ()
    assert not is_lit_by_world(SceneSnapshot("s", environment=environment))


@pytest.mark.parametrize("radiance", [(math.nan, 1.0, 1.0), (1.0, math.inf, 1.0), (-1.0, 1.0, 1.0)])
def test_radiance_that_means_nothing_is_refused(radiance: tuple[float, float, float]) -> None:
    assert is_lit_by_world(SceneSnapshot("s", world_radiance=radiance))
    with pytest.raises(InvalidInput, match="world: its radiance is"):
        world_lights(radiance, None, 64)


def test_a_broken_map_is_refused() -> None:
    broken = Environment("attic", np.full((4, 8, 3), np.nan, np.float32), UNTURNED)
    assert is_lit_by_world(SceneSnapshot("s", environment=broken))
    with pytest.raises(InvalidInput, match="environment 'attic'"):
        world_lights(BLACK, broken, 64)


def test_the_same_world_gives_the_same_lights() -> None:
    environment = Environment("e", sky(), TURN)
    assert world_lights((0.1, 0.2, 0.3), environment, 64) == world_lights((0.1, 0.2, 0.3), environment, 64)


def test_a_world_survives_the_way_to_the_renderers_process() -> None:
    environment = Environment("attic", sky(8, 16), TURN)
    snapshot = SceneSnapshot("s", lights=world_lights((0.1, 0.2, 0.3), environment, 4), environment=environment)
    tree, arrays = flatten(snapshot)
    found = snapshot_from_tree(unflatten(json.loads(json.dumps(tree)), arrays))
    assert found.lights == snapshot.lights
    assert found.environment is not None
    assert found.environment.name == "attic"
    np.testing.assert_array_equal(found.environment.radiance, environment.radiance)
    np.testing.assert_array_equal(found.environment.map_from_world, TURN)
