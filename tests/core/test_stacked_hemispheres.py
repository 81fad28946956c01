# SPDX-License-Identifier: GPL-3.0-or-later
"""Hemispheres of lights against the figures and formulas of seed 000."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.stacked_hemispheres import (
    emission_share,
    hemisphere_rays,
    integrated_shadow_count,
    light_count,
    ray_count,
    ring_count,
    shadow_map_bytes,
    shell_attenuations,
    shell_distances,
)


@pytest.mark.parametrize(
    ("angle", "shells", "published"),
    [
        *((5, 5, 6485), (10, 5, 1625), (30, 5, 185), (45, 5, 85), (90, 5, 25)),
        *((5, 4, 5188), (5, 3, 3891), (5, 2, 2594), (5, 1, 1297), (5, 6, 7782)),
    ],
)
def test_counts_are_those_of_tables_5_1_and_5_2(angle: float, shells: int, published: int) -> None:
    assert light_count(angle, shells) == published
    assert shells * len(hemisphere_rays(angle)) == published


@pytest.mark.parametrize("angle", [5.0, 7.0, 13.0, 30.0, 90.0])
def test_rays_are_unit_and_fill_the_hemisphere_in_equal_steps(angle: float) -> None:
    rays = hemisphere_rays(angle)
    assert len(rays) == ray_count(angle)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-15)
    np.testing.assert_array_equal(rays[0], [0.0, 0.0, 1.0])
    step = 0.5 * math.pi / ring_count(angle)
    polar = np.arccos(np.clip(rays[1:, 2], -1.0, 1.0)) / step
    azimuth = np.arctan2(rays[1:, 1], rays[1:, 0]) / step % (4 * ring_count(angle))
    np.testing.assert_allclose(polar, np.round(polar), atol=1e-6)
    found = {(int(p), int(a) % (4 * ring_count(angle))) for p, a in zip(polar.round(), azimuth.round(), strict=True)}
    assert found == {(p, a) for p in range(1, ring_count(angle) + 1) for a in range(4 * ring_count(angle))}


def test_rays_are_the_seeds_rotation_with_the_old_components() -> None:
    """Section 4.1, about a lamp that looks along -y: first around z, then around y."""
    expected = [np.array([0.0, -1.0, 0.0])]
    for about_z in np.radians(np.arange(30, 91, 30)):
        for about_y in np.radians(np.arange(0, 360, 30)):
            x, y, z = math.cos(about_z) * 0 - math.sin(about_z) * -1, math.cos(about_z) * -1, 0.0
            turned = math.cos(about_y) * x + math.sin(about_y) * z, y, -math.sin(about_y) * x + math.cos(about_y) * z
            expected.append(np.array(turned))
    # In our frame the axis is z, and azimuth turns from x to y.
    frame = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
    np.testing.assert_allclose(hemisphere_rays(30) @ frame, expected, atol=1e-15)


def test_distances_are_those_of_equation_4_1() -> None:
    np.testing.assert_allclose(shell_distances(5, 32.0), [16.0, 24.0, 28.0, 30.0, 31.0])


def test_attenuation_is_that_of_equation_4_2_and_takes_no_more_than_all() -> None:
    np.testing.assert_allclose(shell_attenuations(5), [0.05, 0.10, 0.20, 0.40, 0.80])
    np.testing.assert_allclose(shell_attenuations(8)[5:], 1.0)


def test_lights_shine_over_240_degrees() -> None:
    """Section 4.2: the cosine from -0.5 to 1 becomes 0 to 1, and a light's half angle is 120 degrees."""
    np.testing.assert_allclose(emission_share([-1.0, -0.5, 0.25, 1.0]), [0.0, 0.0, 0.5, 1.0])
    assert emission_share(math.cos(math.radians(119.9))) > 0.0
    assert emission_share(math.cos(math.radians(120.1))) == 0.0


@pytest.mark.parametrize(("steps", "published"), [(2, 40), (4, 60), (6, 80), (10, 120)])
def test_shadows_between_five_maps_are_those_of_table_5_11(steps: int, published: int) -> None:
    assert integrated_shadow_count(5, steps) == published


@pytest.mark.parametrize(("maps", "published"), [(21, 664.45), (1, 31.64), (6, 189.84)])
def test_memory_is_that_of_section_5_2_2(maps: int, published: float) -> None:
    """Cut, not rounded, in equation 5.4."""
    assert shadow_map_bytes(1280, 720, 3.0, maps) / 1024**2 == pytest.approx(published, abs=0.01)


@pytest.mark.parametrize("angle", [0.0, -5.0, 91.0, math.nan])
def test_an_angle_that_makes_no_hemisphere_is_refused(angle: float) -> None:
    with pytest.raises(InvalidInput, match="angle between rays"):
        hemisphere_rays(angle)
