# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of lamps against sums over their shape, and sample points against the shapes they stand for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vlm_addon.core import lamps
from vlm_addon.core.scene import AREA, ELLIPSE, POINT, RECTANGLE, SPOT, SUN, Light

POWER = (10.0, 20.0, 30.0)
UP = np.array([[0.0, 0.0, 1.0]])


def lamp(kind: str, **changes: object) -> Light:
    return replace(Light("lamp", kind, POWER, (0.0, 0.0, 2.0)), **changes)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def disk(count: int) -> np.ndarray:
    """Points evenly spread over the unit disk."""
    i = np.arange(count) + 0.5
    r, phi = np.sqrt(i / count), math.pi * (1 + math.sqrt(5)) * i
    return np.stack([r * np.cos(phi), r * np.sin(phi)], axis=-1)


def test_point_lamp_sends_its_power_through_a_sphere_around_it() -> None:
    directions = unit(np.random.default_rng(1).normal(size=(1000, 3)))
    light = lamp(POINT)
    irradiance = lamps.lamp_irradiance(light, np.array(light.position) + 3.0 * directions, -directions)
    np.testing.assert_allclose(irradiance.mean(axis=0) * 4 * math.pi * 9.0, POWER, rtol=1e-12)


def test_area_lamp_sends_its_power_through_a_plane_before_it() -> None:
    x = (np.arange(400) + 0.5) / 400 * 400.0 - 200.0
    points = np.stack([*np.meshgrid(x, x), np.zeros((400, 400))], axis=-1).reshape(-1, 3)
    light = lamp(AREA, size_x=0.5, size_y=2.0)
    total = lamps.lamp_irradiance(light, points, np.repeat(UP, len(points), axis=0)).sum(axis=0)
    np.testing.assert_allclose(total, POWER, rtol=2e-3)


@pytest.mark.parametrize("shape", [RECTANGLE, ELLIPSE])
@pytest.mark.parametrize("point", [[0.0, 0.0, 0.0], [2.0, 1.0, 0.5], [0.3, 0.0, 1.8]])
def test_area_lamp_against_a_sum_over_its_surface(shape: str, point: list[float]) -> None:
    light = lamp(AREA, shape=shape, size_x=1.0, size_y=0.6)
    if shape == ELLIPSE:
        on_lamp = disk(200_000) * [0.5, 0.3]
    else:
        x = (np.arange(500) + 0.5) / 500 - 0.5
        on_lamp = np.stack(np.meshgrid(x, 0.6 * x), axis=-1).reshape(-1, 2)
    normal = unit(np.array([0.2, -0.3, 0.5]))
    to_lamp = np.concatenate([on_lamp, np.full((len(on_lamp), 1), 2.0)], axis=1) - point
    squared = (to_lamp**2).sum(-1)
    cosines = np.maximum(to_lamp @ normal, 0.0) * to_lamp[:, 2] / squared
    expected = (cosines / squared).mean() * np.array(POWER) / math.pi
    found = lamps.lamp_irradiance(light, np.array([point]), normal[None])[0]
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("distance", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("tilt", [0.0, 0.8, 1.4, 1.6])
def test_soft_point_lamp_is_a_disk_turned_to_the_receiver(distance: float, tilt: float) -> None:
    light = lamp(POINT, radius=0.5)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    on_disk = np.concatenate([0.5 * disk(400_000), np.full((400_000, 1), distance)], axis=1)
    squared = (on_disk**2).sum(-1)
    radiance = np.array(POWER) / (4 * math.pi) / (math.pi * 0.25)
    cosines = np.maximum(on_disk @ normal, 0.0) * distance / squared
    expected = radiance * (cosines / squared).mean() * math.pi * 0.25
    found = lamps.lamp_irradiance(light, np.array([[0.0, 0.0, 2.0 - distance]]), normal[None])[0]
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("tilt", [0.0, 1.0, 1.5, 1.7])
def test_hard_falloff_is_a_ball_of_constant_radiance(tilt: float) -> None:
    light = lamp(POINT, radius=0.8, soft_falloff=False)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    sine = 0.4
    # Directions of a cone, even in projected solid angle.
    rim = disk(400_000) * sine
    directions = np.concatenate([rim, np.sqrt(1.0 - (rim**2).sum(-1, keepdims=True))], axis=1)
    radiance = np.array(POWER) / (4 * math.pi * math.pi * 0.64)
    expected = radiance * math.pi * sine**2 * (np.maximum(directions @ normal, 0.0) / directions[:, 2]).mean()
    found = lamps.lamp_irradiance(light, np.zeros((1, 3)), normal[None])[0]
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("angle", [0.0, 0.01, 0.5, 2.0])
def test_sun_gives_its_strength_to_a_facing_surface(angle: float) -> None:
    found = lamps.lamp_irradiance(lamp(SUN, angle=angle), np.zeros((1, 3)), UP)[0]
    np.testing.assert_allclose(found, POWER, rtol=1e-12)


@pytest.mark.parametrize(("cosine", "sine"), [(0.0, 0.02), (0.01, 0.029), (-0.01, 0.031), (0.2, 0.5), (-0.5, 0.9)])
def test_cone_cut_by_the_horizon_against_a_sum(cosine: float, sine: float) -> None:
    rim = disk(1_000_000) * sine
    directions = np.concatenate([rim, np.sqrt(1.0 - (rim**2).sum(-1, keepdims=True))], axis=1)
    normal = np.array([math.sqrt(1.0 - cosine**2), 0.0, cosine])
    expected = (np.maximum(directions @ normal, 0.0) / directions[:, 2]).mean()
    assert lamps.horizon_cosine(np.array(cosine), np.array(sine)) == pytest.approx(expected, rel=2e-3, abs=1e-6)


def test_hemispherical_sky_is_half_seen_by_a_wall() -> None:
    assert lamps.horizon_cosine(np.array(0.0), np.array(1.0)) == pytest.approx(0.5, abs=1e-6)


def spot_at(angle: float, **changes: object) -> float:
    """Irradiance of a spot on a surface facing it at `angle` off its axis, over that of a point lamp."""
    direction = np.array([math.sin(angle), 0.0, -math.cos(angle)])
    points = np.array([[0.0, 0.0, 2.0]]) + direction
    spot = lamps.lamp_irradiance(lamp(SPOT, **changes), points, -direction[None])
    return float((spot / lamps.lamp_irradiance(lamp(POINT), points, -direction[None]))[0, 0])


def test_spot_is_full_inside_and_nothing_outside_its_cone() -> None:
    assert spot_at(0.1, spot_angle=1.0, spot_blend=0.2) == 1.0
    assert spot_at(0.51, spot_angle=1.0, spot_blend=0.2) == 0.0
    assert 0.0 < spot_at(0.48, spot_angle=1.0, spot_blend=0.2) < 1.0


def test_spot_scale_widens_the_cone() -> None:
    assert spot_at(0.6, spot_angle=1.0, spot_blend=0.0) == 0.0
    assert spot_at(0.6, spot_angle=1.0, spot_blend=0.0, spot_scale=(2.0, 1.0)) == 1.0


@pytest.mark.parametrize("count", [1, 2, 5, 7, 16, 36])
@pytest.mark.parametrize("shape", [RECTANGLE, ELLIPSE])
def test_cells_of_an_area_lamp_sum_to_it(shape: str, count: int) -> None:
    light = lamp(AREA, shape=shape, size_x=1.0, size_y=0.6)
    samples = lamps.lamp_samples(light, count)
    assert sum(sample.share for sample in samples) == pytest.approx(1.0)
    areas = []
    for sample in samples:
        x, y = sample.cell.T
        # Clockwise seen from +z is counter-clockwise seen from the shining side.
        areas.append(-0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()))
    np.testing.assert_allclose(areas, lamps.area_of(light) / count, rtol=1e-9)
    offsets = np.array([sample.position for sample in samples]) - light.position
    assert (np.abs(offsets) <= [0.5, 0.3, 0.0]).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_of_a_soft_point_lamp_cover_its_disk_from_every_side(axis: int) -> None:
    samples = lamps.lamp_samples(lamp(POINT, radius=0.5), 400)
    offsets = (np.array([sample.position for sample in samples]) - [0.0, 0.0, 2.0]) / 0.5
    radii_squared = np.sort((np.delete(offsets, axis, axis=1) ** 2).sum(-1))
    # Even cover: the share of points within radius r is r².
    np.testing.assert_allclose(radii_squared, (np.arange(400) + 0.5) / 400, atol=0.06)


def test_directions_of_a_soft_sun_fill_its_cone() -> None:
    samples = lamps.lamp_samples(lamp(SUN, angle=0.6), 100)
    directions = np.array([sample.position for sample in samples])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-12)
    cosines = np.sort(directions[:, 2])[::-1]
    np.testing.assert_allclose((1 - cosines) / (1 - math.cos(0.3)), (np.arange(100) + 0.5) / 100, atol=0.06)


@pytest.mark.parametrize(("kind", "soft"), [(POINT, False), (SUN, False), (AREA, True)])
def test_hard_lamps_need_one_sample(kind: str, soft: bool) -> None:
    assert lamps.is_soft(lamp(kind)) is soft
    assert len(lamps.lamp_samples(lamp(kind), 8)) == (8 if soft else 1)
