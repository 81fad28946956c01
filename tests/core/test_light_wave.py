# SPDX-License-Identifier: GPL-3.0-or-later
"""Waves of lamps of every kind: where their lights are, what they carry, which of them cast shadows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vlm_addon.core.light_wave import (
    SPREAD_LIGHTS,
    Wave,
    WaveSettings,
    end_distances,
    lamp_waves,
    mean_end_distance,
    sampled_frames,
    sampled_lights,
    spread_frames,
    spread_lights,
)
from vlm_addon.core.scene import AREA, POINT, SPOT, SUN, Float64, Light
from vlm_addon.core.stacked_hemispheres import light_count, shell_attenuations, shell_distances

LOW, HIGH = np.array([-2.0, -1.5, -1.25]), np.array([2.0, 1.5, 1.25])
PUBLISHED = WaveSettings(5.0, 5, 1.0, 1.0)
COARSE = WaveSettings(30.0, 5, 1.0, 1.0)
POWER = (40.0, 20.0, 10.0)
WIDE_SPOT = Light("l", SPOT, POWER, (0.0, 0.0, 1.2), spot_angle=math.pi, spot_blend=0.0)


def only(light: Light, settings: WaveSettings = COARSE, low: Float64 = LOW, high: Float64 = HIGH) -> Wave:
    (wave,) = lamp_waves(light, low, high, settings)
    return wave


def test_a_lamps_lights_lie_on_shells_around_it_and_look_away_from_it() -> None:
    wave = only(WIDE_SPOT, PUBLISHED)
    assert len(wave) == 6485
    offsets = wave.positions - WIDE_SPOT.position
    distances = np.linalg.norm(offsets, axis=1)
    np.testing.assert_allclose(distances, shell_distances(5, wave.max_distance)[wave.shells], rtol=1e-12)
    np.testing.assert_allclose(wave.normals * distances[:, None], offsets, atol=1e-12)
    assert (wave.normals[:, 2] <= 1e-12).all()
    np.testing.assert_allclose(wave.normals[0], [0.0, 0.0, -1.0])


def test_a_turned_lamp_turns_its_wave() -> None:
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    axes *= np.linalg.det(axes)
    turned = replace(
        WIDE_SPOT, x_axis=tuple(axes[0]), y_axis=tuple(axes[1]), z_axis=tuple(axes[2]), position=(0.1, 0.2, 0.3)
    )
    wave, straight = only(turned), only(WIDE_SPOT)
    np.testing.assert_allclose(wave.normals @ axes.T, straight.normals, atol=1e-12)


def test_all_lights_that_face_a_surface_bring_what_a_lamp_at_the_mean_distance_brings_less_attenuation() -> None:
    """Equation 4.5: the mean over all lights of 1 - attenuation."""
    wave = only(replace(WIDE_SPOT, position=(0.0, 0.0, 0.0)), PUBLISHED)
    below = wave.normals[:, 2] < -1e-9
    facing = np.array(POWER) / (4.0 * math.pi) / wave.max_distance**2
    expected = facing * (1.0 - shell_attenuations(5)).mean() * below.mean()
    np.testing.assert_allclose(wave.irradiance[below].sum(axis=0), expected, rtol=1e-12)
    np.testing.assert_allclose(wave.specular_irradiance[below].sum(axis=0), facing * below.mean(), rtol=1e-12)


def test_reach_moves_the_lights_and_leaves_what_they_carry() -> None:
    near, far = only(WIDE_SPOT, replace(COARSE, reach=0.5)), only(WIDE_SPOT)
    assert near.max_distance == pytest.approx(0.5 * far.max_distance)
    np.testing.assert_allclose(near.irradiance, far.irradiance)


def test_light_of_the_sixth_shell_is_counted_and_dark() -> None:
    five, six = only(WIDE_SPOT), only(WIDE_SPOT, replace(COARSE, shells=6))
    assert (six.irradiance[six.shells == 5] == 0.0).all()
    np.testing.assert_allclose(six.irradiance[six.shells < 5].sum(), five.irradiance.sum() * 5 / 6)


def test_a_point_lamp_sends_waves_both_ways() -> None:
    first, second = lamp_waves(Light("l", POINT, POWER, (0.0, 0.0, 0.0)), LOW, HIGH, COARSE)
    np.testing.assert_allclose(first.normals[:, 2], -second.normals[:, 2], atol=1e-15)
    np.testing.assert_allclose(first.irradiance.sum(axis=0), second.irradiance.sum(axis=0), rtol=1e-12)


def test_a_spot_lights_only_the_rays_in_its_cone() -> None:
    wave = only(replace(WIDE_SPOT, spot_angle=math.radians(70.0)))
    in_cone = -wave.normals[:, 2] > math.cos(math.radians(35.0))
    assert ((wave.irradiance.max(axis=1) > 0.0) == in_cone).all()


def test_an_area_lamps_rays_carry_less_towards_the_rim_by_lamberts_law() -> None:
    wave = only(Light("l", AREA, POWER, (0.0, 0.0, 1.25), size_x=0.5, size_y=0.5))
    facing = np.array(POWER) / math.pi / wave.max_distance**2 / len(wave)
    np.testing.assert_allclose(wave.specular_irradiance, -wave.normals[:, 2:] * facing, atol=1e-12)


def test_a_suns_wave_starts_at_the_end_of_the_scene_and_carries_its_irradiance() -> None:
    wave = only(Light("l", SUN, (3.0, 2.0, 1.0), (50.0, 0.0, 0.0)))
    np.testing.assert_allclose(wave.positions[0], [0.0, 0.0, 1.25 - 0.5 * wave.max_distance])
    np.testing.assert_allclose(wave.specular_irradiance[0] * len(wave), [3.0, 2.0, 1.0])


def test_a_lamp_outside_that_looks_away_carries_no_light() -> None:
    away = Light("l", SPOT, POWER, (0.0, 0.0, -9.0), spot_angle=2.0)
    assert (only(away).irradiance == 0.0).all()
    assert np.isfinite(only(away).positions).all()


@pytest.mark.parametrize("settings", [COARSE, replace(COARSE, active_share=0.001)])
def test_a_scene_without_extent_and_a_lamp_in_it_stay_finite(settings: WaveSettings) -> None:
    wave = only(replace(WIDE_SPOT, position=(0.0, 0.0, 0.0)), settings, np.zeros(3), np.zeros(3))
    assert np.isfinite(wave.irradiance).all()
    assert np.isfinite(wave.positions).all()
    assert len(wave) >= 1


def test_end_distances_are_those_of_a_box() -> None:
    rays = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(end_distances(np.zeros(3), rays, LOW, HIGH), [2.0, 1.5, 1.25 / 0.8, 1.25], rtol=1e-5)
    outside = np.array([-5.0, 0.0, 0.0])
    np.testing.assert_allclose(end_distances(outside, rays, LOW, HIGH), [7.0, 0.0, 0.0, 0.0], rtol=1e-5)
    on_edge = np.array([0.0, 0.0, 1.25])
    np.testing.assert_allclose(end_distances(on_edge, -rays, LOW, HIGH)[3], 2.5, rtol=1e-5)


def test_mean_end_distance_is_the_mean_square_over_the_hemisphere() -> None:
    """Against a fine grid of directions, each with the nearest of three walls."""
    position, frame = np.array([0.3, -0.2, 0.9]), np.diag([1.0, 1.0, -1.0])
    cosines = (np.arange(800) + 0.5) / 800
    turns = 2.0 * math.pi * (np.arange(800) + 0.5) / 800
    z, turn = (part.ravel() for part in np.meshgrid(cosines, turns))
    ring = np.sqrt(1.0 - z * z)
    rays = np.stack([ring * np.cos(turn), ring * np.sin(turn), -z], axis=1)
    to_walls = np.where(rays > 0.0, HIGH - position, LOW - position) / rays
    expected = math.sqrt((to_walls.min(axis=1) ** 2).mean())
    assert mean_end_distance(position, frame, LOW, HIGH) == pytest.approx(expected, rel=0.01)


def test_switched_off_lights_leave_a_part_of_the_others_and_the_same_light_on_average() -> None:
    half, tenth, all_on = (only(WIDE_SPOT, replace(PUBLISHED, active_share=share)) for share in (0.5, 0.1, 1.0))
    assert len(half) == round(0.5 * 6485)
    places = {tuple(place) for place in half.positions}
    assert {tuple(place) for place in tenth.positions} <= places
    assert places <= {tuple(place) for place in all_on.positions}
    np.testing.assert_allclose(half.irradiance.sum(axis=0), all_on.irradiance.sum(axis=0), rtol=0.03)
    again = only(WIDE_SPOT, replace(PUBLISHED, active_share=0.5))
    np.testing.assert_array_equal(again.positions, half.positions)


def test_sampled_lights_are_inside_the_bounds_and_fewer_are_a_part_of_more() -> None:
    wave = only(WIDE_SPOT, PUBLISHED)
    twenty = sampled_lights(wave, 20)
    assert len(set(twenty.tolist())) == 20
    assert wave.inside[twenty].all()
    assert not wave.inside.all()
    assert set(sampled_lights(wave, 15).tolist()) < set(twenty.tolist())
    assert len(sampled_lights(wave, 10**6)) <= len(wave)


def test_spread_lights_are_the_innermost_shells_axis_and_four_a_quarter_turn_apart() -> None:
    wave = only(replace(WIDE_SPOT, position=(0.0, 0.0, 0.0)))
    lights = spread_lights(wave)
    assert len(lights) == SPREAD_LIGHTS
    assert (wave.shells[lights] == 0).all()
    expected = [[0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
    np.testing.assert_allclose(wave.normals[lights], expected, atol=1e-12)


def test_spread_lights_stay_inside_the_bounds_where_they_can() -> None:
    corner = replace(WIDE_SPOT, position=(-1.9, -1.4, 1.2))
    wave = only(corner, PUBLISHED)
    lights = spread_lights(wave)
    assert wave.inside[lights].all()
    np.testing.assert_allclose(wave.normals[lights[[1, 3]]], [[1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_frames_of_maps_are_rotations_about_the_shortest_arc() -> None:
    wave = only(WIDE_SPOT)
    lights = np.arange(light_count(30.0, 1))
    frames = sampled_frames(wave, lights)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(lights), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), np.linalg.det(wave.frame), atol=1e-12)
    np.testing.assert_allclose(frames[:, 2], wave.normals[lights], atol=1e-15)
    np.testing.assert_allclose(frames[0], wave.frame, atol=1e-15)
    # The axis of the turn keeps its place in both frames.
    turn = np.cross(wave.frame[2], wave.normals[lights[1:]])
    np.testing.assert_allclose(np.einsum("mij,mj->mi", frames[1:], turn), turn @ wave.frame.T, atol=1e-12)
    np.testing.assert_array_equal(spread_frames(wave, lights)[3], wave.frame)
