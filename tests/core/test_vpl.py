# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual point lights against closed forms of disks, spheres and rooms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import Float64
from vlm_addon.core.vpl import VirtualPointLights, vpl_irradiance

UP = np.array([[0.0, 0.0, 1.0]])
RGB = np.array([1.0, 2.0, 4.0])


def one(position: list[float], normal: list[float], flux: float = 1.0, area: float = 0.0) -> VirtualPointLights:
    return VirtualPointLights(np.array([position]), np.array([normal]), flux * RGB[None], np.array([area]))


def disk(radius: float, height: float, count: int, radiosity: float = 1.0) -> VirtualPointLights:
    """A disk over the origin that looks down, in pieces of equal area on a spiral."""
    index = np.arange(count) + 0.5
    distance, angle = radius * np.sqrt(index / count), np.pi * (3.0 - np.sqrt(5.0)) * index
    positions = np.stack([distance * np.cos(angle), distance * np.sin(angle), np.full(count, height)], axis=1)
    areas = np.full(count, np.pi * radius**2 / count)
    return VirtualPointLights(positions, np.tile(-UP, (count, 1)), radiosity * areas[:, None] * RGB, areas)


def test_far_from_a_light_it_is_lamberts_law() -> None:
    point = np.array([[3.0, -2.0, 1.0]])
    found = vpl_irradiance(point, UP, one([0.0, 0.0, 5.0], [0.6, 0.0, -0.8], flux=7.0))
    squared = 3.0**2 + 2.0**2 + 4.0**2
    cosines = 4.0 * (0.6 * 3.0 - 0.8 * -4.0) / squared
    np.testing.assert_allclose(found.irradiance[0], 7.0 * RGB * cosines / (np.pi * squared), rtol=1e-14)
    assert not found.removed.any()


@pytest.mark.parametrize("height", [0.3, 1.0, 5.0])
def test_on_the_axis_one_light_is_the_disk_of_its_area(height: float) -> None:
    """Irradiance below a disk of radiosity B: B R² / (R² + h²)."""
    radius, radiosity = 0.7, 3.0
    area = np.pi * radius**2
    found = vpl_irradiance(np.zeros((1, 3)), UP, one([0.0, 0.0, height], [0.0, 0.0, -1.0], radiosity * area, area))
    np.testing.assert_allclose(found.irradiance[0], radiosity * RGB * radius**2 / (radius**2 + height**2), rtol=1e-14)


def test_pieces_of_a_disk_sum_to_the_disk() -> None:
    found = vpl_irradiance(np.zeros((1, 3)), UP, disk(1.0, 0.5, 100_000))
    np.testing.assert_allclose(found.irradiance[0], RGB / (1.0 + 0.25), rtol=1e-3)
    np.testing.assert_allclose(found.removed[0], 0.0, atol=1e-3)


def test_bounded_and_removed_are_the_unbounded_together() -> None:
    random = np.random.default_rng(2)
    unit = random.normal(size=(60, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    lights = VirtualPointLights(random.normal(size=(60, 3)), unit, random.random((60, 3)), random.random(60))
    points, normals = random.normal(size=(700, 3)), np.tile(UP, (700, 1))
    found = vpl_irradiance(points, normals, lights)
    unbounded = vpl_irradiance(points, normals, replace(lights, areas=np.zeros(60)))
    np.testing.assert_allclose(found.irradiance + found.removed, unbounded.irradiance, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("distance", [1.0, 1e-3, 1e-9, 1e-150, 0.0])
def test_nothing_is_brighter_than_the_light_itself(distance: float) -> None:
    area, radiosity = 0.01, 5.0
    found = vpl_irradiance(np.zeros((1, 3)), UP, one([0.0, 0.0, distance], [0.0, 0.0, -1.0], radiosity * area, area))
    assert (found.irradiance <= radiosity * RGB).all()
    assert np.isfinite(found.irradiance).all()


def test_behind_the_light_and_below_the_horizon_is_nothing() -> None:
    above = one([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
    below = one([0.0, 0.0, -1.0], [0.0, 0.0, 1.0])
    for lights in (above, below):
        found = vpl_irradiance(np.zeros((1, 3)), UP, lights)
        assert not found.irradiance.any()
        assert not found.removed.any()


def test_no_lights_give_nothing() -> None:
    none = VirtualPointLights(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    assert vpl_irradiance(np.zeros((4, 3)), np.tile(UP, (4, 1)), none).irradiance.tolist() == [[0.0] * 3] * 4


def test_inside_a_sphere_flux_spreads_evenly() -> None:
    """A piece of a sphere's inside lights all of it alike: flux over the sphere's area."""
    random = np.random.default_rng(3).normal(size=(200, 3))
    points: Float64 = 2.0 * random / np.linalg.norm(random, axis=1, keepdims=True)
    found = vpl_irradiance(points, -points / 2.0, one([0.0, 0.0, -2.0], [0.0, 0.0, 1.0], flux=3.0))
    np.testing.assert_allclose(found.irradiance, np.tile(3.0 * RGB / (16.0 * np.pi), (200, 1)), rtol=1e-10)


@pytest.mark.parametrize(("name", "value"), [("flux", -1.0), ("areas", -1.0), ("positions", np.nan)])
def test_refuses_what_is_no_light(name: str, value: float) -> None:
    lights = one([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    broken = replace(lights, **{name: np.full_like(getattr(lights, name), value)})
    with pytest.raises(InvalidInput):
        vpl_irradiance(np.zeros((1, 3)), UP, broken)
