# SPDX-License-Identifier: GPL-3.0-or-later
"""LightWave against sums in numpy and rays, and what must hold whatever the lamps do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, inward_box
from tests.render.rooms import quad
from tests.render.wave_oracle import occluded, unshadowed, waves_of
from vlm_addon.core.brdf import principled_brdf
from vlm_addon.core.light_wave import sampled_frames, sampled_lights, spread_frames, spread_lights
from vlm_addon.core.scene import AREA, POINT, PRINCIPLED, SPOT, SUN, Float64, Light, Material, Mesh, SceneSnapshot
from vlm_addon.core.stacked_hemispheres import light_count
from vlm_addon.render import wave_shadows
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.passes.wave_shadow import MAP_TANGENT

WIDTH, HEIGHT = 32, 24
ANGLE = 15.0
SPOT_LAMP = Light("spot", SPOT, (45.0, 30.0, 20.0), (0.3, 0.2, 1.1), spot_angle=2.6, spot_blend=0.2)
POINT_LAMP = Light("point", POINT, (45.0, 45.0, 45.0), (0.4, -0.3, 0.2))
LAMPS = {
    "spot": SPOT_LAMP,
    "point": POINT_LAMP,
    "area": Light("area", AREA, (20.0, 40.0, 20.0), (0.0, 0.0, 1.2), size_x=1.0, size_y=0.8),
    "sun": Light("sun", SUN, (2.0, 2.0, 3.0), (0.0, 0.0, 0.0)),
}


def rendered(device: Device, snapshot: SceneSnapshot, samples: int = 1, **settings: object) -> Frame:
    values = {"angle": ANGLE, "maps": 8, "map_scale": 8.0, **settings}
    return device.render(
        snapshot, None, RenderSettings(WIDTH, HEIGHT, "lightwave", values, samples, 64, 2, buffers=True)
    )


def block(x: float = 0.4) -> tuple[Mesh, ...]:
    """A block of the first material on the floor of the empty room."""
    return tuple(inward_box((x, -0.1, -1.25), (x + 0.6, 0.6, -0.3), [0] * 6, outward=True))


def furnished(*lights: Light, x: float = 0.4) -> SceneSnapshot:
    room = empty_room(lights)
    return replace(room, meshes=(*room.meshes, *block(x)))


def seen(frame: Frame) -> tuple[Float64, Float64]:
    """Positions and normals of all pixels."""
    return tuple(frame.images[name].reshape(-1, 3).astype(float) for name in ("position", "normal"))  # type: ignore


def fresh(snapshot: SceneSnapshot, **settings: object) -> Frame:
    with Device() as opened:
        return rendered(opened, snapshot, **settings)  # type: ignore[arg-type]


def same(first: Frame, second: Frame) -> bool:
    return all((image == second.images[name]).all() for name, image in first.images.items())


@pytest.mark.parametrize("name", LAMPS)
def test_light_at_pixels_is_the_sum_over_the_lights(device: Device, name: str) -> None:
    room = furnished(LAMPS[name])
    frame = rendered(device, room, computed_at="pixels", shadows="none")
    expected = unshadowed(waves_of(room, ANGLE), *seen(frame))
    assert expected.max() > 0.0
    np.testing.assert_allclose(frame.images["irradiance"].reshape(-1, 3), expected, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("name", LAMPS)
def test_light_at_corners_is_the_sum_there_spread_evenly_over_triangles(device: Device, name: str) -> None:
    room = furnished(LAMPS[name])
    frame = rendered(device, room, shadows="none")
    faces = frame.images["face_id"].astype(int).ravel()
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in room.meshes])[faces]
    normals = np.concatenate([mesh.corner_normals for mesh in room.meshes]).astype(float)[faces]
    points, _ = seen(frame)
    matrices = np.concatenate([corners.transpose(0, 2, 1), np.ones((len(corners), 1, 3))], axis=1)
    targets = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    weights = np.stack([np.linalg.lstsq(m, t, rcond=None)[0] for m, t in zip(matrices, targets, strict=True)])
    waves = waves_of(room, ANGLE)
    at_corners = np.stack([unshadowed(waves, corners[:, k], normals[:, k]) for k in range(3)], axis=1)
    expected = np.einsum("pk,pkc->pc", weights, at_corners)
    np.testing.assert_allclose(frame.images["irradiance"].reshape(-1, 3), expected, rtol=2e-3, atol=1e-4)


def test_the_clockwise_side_is_lit_by_what_is_on_that_side(device: Device) -> None:
    floor = quad((-2.0, -1.5, -1.0), (4.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    room = replace(empty_room([SPOT_LAMP]), meshes=(floor,))
    turned = replace(
        floor, triangles=floor.triangles[:, ::-1].copy(), corner_normals=np.ascontiguousarray(-floor.corner_normals)
    )
    front, back = (rendered(device, replace(room, meshes=(mesh,)), shadows="none") for mesh in (floor, turned))
    assert front.images["irradiance"].max() > 0.0
    np.testing.assert_allclose(front.images["irradiance"], back.images["irradiance"], rtol=1e-5, atol=1e-6)


def shadow_by_rays(room: SceneSnapshot, points: Float64, normals: Float64, spread: bool, reach: float) -> Float64:
    """(p,) mean over the maps of what each sees; 1 outside of a map."""
    (wave,) = waves_of(room, ANGLE, reach=reach)
    lights = spread_lights(wave) if spread else sampled_lights(wave, 8)
    frames = spread_frames(wave, lights) if spread else sampled_frames(wave, lights)
    tangents = MAP_TANGENT * np.array([WIDTH, HEIGHT]) / min(WIDTH, HEIGHT)
    total = np.zeros(len(points))
    for light, axes in zip(wave.positions[lights], frames, strict=True):
        place = (points - light) @ axes.T
        outside = (place[:, 2] <= 0.0) | (np.abs(place[:, :2]) > tangents * place[:, 2:]).any(axis=1)
        away = np.einsum("pk,pk->p", light - points, normals) <= 0.0
        total += np.where(outside, 1.0, ~(away | occluded(room.meshes, points, light)))
    return total / len(lights)


@pytest.mark.parametrize("shadows", ["accurate", "integrated"])
def test_shadows_of_single_maps_are_those_of_rays(device: Device, shadows: str) -> None:
    """Without steps the five maps that are integrated between count alike."""
    room = empty_room([SPOT_LAMP])
    plate = inward_box((-0.6, -0.6, -0.7), (1.5, 1.0, -0.6), [0] * 6, outward=True)
    room = replace(room, meshes=(*room.meshes, *plate))
    reach = 0.6
    frame = rendered(device, room, shadows=shadows, steps=0, computed_at="pixels", reach=reach)
    lit = frame.images["lightwave_unshadowed"].reshape(-1, 3).min(axis=1) > 0.0
    found = frame.images["lightwave_indirect_shadow"][..., 0].ravel()
    expected = shadow_by_rays(room, *seen(frame), shadows == "integrated", reach)
    shadow, off = (1.0 - expected)[lit], np.abs(found - expected)[lit]
    assert (shadow > 0.1).mean() > 0.1
    # Edges of shadows fall within a pixel.
    assert off.sum() < 0.15 * shadow.sum()
    assert (off < 0.01).mean() > 0.95


def test_steps_in_between_smooth_the_shadows(device: Device) -> None:
    room = furnished(SPOT_LAMP)
    levels = []
    for steps in (0, 10):
        frame = rendered(device, room, shadows="integrated", steps=steps, computed_at="pixels")
        levels.append(len(np.unique(frame.images["lightwave_indirect_shadow"][..., 0].round(3))))
        assert frame.counters["indirect_shadows"] == 10 * (steps + 2)
        assert frame.counters["indirect_shadow_maps"] == 5
    assert levels[1] > 1.5 * levels[0]


def test_shadows_leave_a_share_of_the_light(device: Device) -> None:
    for shadows in ("accurate", "integrated"):
        frame = rendered(device, furnished(SPOT_LAMP), shadows=shadows)
        share = frame.images["lightwave_indirect_shadow"]
        assert (share >= 0.0).all()
        assert (share <= 1.0 + 1e-5).all()
        shadowed = frame.images["lightwave_unshadowed"] * share
        np.testing.assert_allclose(frame.images["irradiance"], shadowed, rtol=1e-4, atol=1e-6)


def test_counts_and_memory_are_the_published_ones(device: Device) -> None:
    frame = device.render(furnished(SPOT_LAMP), None, RenderSettings(16, 9, "lightwave", {}, 1, 32, 1))
    assert frame.counters["virtual_point_lights"] == 6485
    assert frame.counters["indirect_shadow_maps"] == frame.counters["indirect_shadows"] == 20
    assert frame.counters["indirect_shadow_map_bytes"] == 4 * 20 * 48 * 27
    assert frame.counters["published_map_bytes"] == 4 * 21 * 48 * 27


def test_only_a_lamps_move_computes_its_lights_anew() -> None:
    """What is drawn anew is what changed, and every picture is that of a new device."""
    other = replace(SPOT_LAMP, name="other", position=(-1.0, 0.4, 1.0))
    start = furnished(SPOT_LAMP, other)
    assert start.camera is not None
    matrix = start.camera.matrix_world.copy()
    matrix[:3, 3] += (0.3, 0.2, -0.1)
    moved_lamp = replace(other, position=(-1.2, 0.4, 1.0))
    steps = [
        (start, 2, 16),
        (start, 0, 0),
        (replace(start, camera=replace(start.camera, matrix_world=matrix)), 0, 0),
        (furnished(SPOT_LAMP, other, x=0.7), 0, 16),
        (furnished(SPOT_LAMP, moved_lamp, x=0.7), 1, 8),
        (furnished(SPOT_LAMP, x=0.7), 0, 0),
        (furnished(SPOT_LAMP, moved_lamp, x=0.7), 1, 8),
    ]
    with Device() as opened:
        for scene, waves, maps in steps:
            frame = rendered(opened, scene)
            assert frame.counters["waves_computed"] == waves
            assert frame.counters["indirect_shadow_maps_drawn"] == maps
            assert same(frame, fresh(scene))


@pytest.mark.parametrize("shadows", ["accurate", "integrated", "none"])
def test_without_lamps_or_when_all_are_off_there_is_no_light(device: Device, shadows: str) -> None:
    assert rendered(device, furnished(SPOT_LAMP), shadows=shadows).images["irradiance"].max() > 0.0
    for lamps in ([], [replace(SPOT_LAMP, power=(0.0, 0.0, 0.0))]):
        frame = rendered(device, furnished(*lamps), shadows=shadows)
        assert frame.images["irradiance"].max() == 0.0
        assert frame.images["direct"].max() == 0.0


def test_a_lamp_that_sees_nothing_lights_nothing(device: Device) -> None:
    away = replace(SPOT_LAMP, position=(0.0, 0.0, -9.0), spot_angle=1.5)
    assert rendered(device, furnished(away)).images["irradiance"].max() == 0.0


def test_a_scene_without_triangles_is_empty(device: Device) -> None:
    nothing = replace(empty_room([SPOT_LAMP]), meshes=())
    assert not rendered(device, nothing).plan.runs("indirect_light")
    # The technique itself, which the plan would leave out.
    wanted = RenderSettings(WIDTH, HEIGHT, "lightwave", samples=1, effects={"indirect_light": "on"})
    frame = device.render(nothing, None, wanted)
    assert frame.counters["virtual_point_lights"] == 0
    assert frame.images["combined"][..., :3].max() == 0.0


@pytest.mark.parametrize(
    "position", [(2.0, 0.0, 0.0), (0.7, 0.25, -0.8), (0.7, -0.1, -0.8)], ids=["wall", "block", "face"]
)
@pytest.mark.parametrize("kind", [POINT, AREA])
def test_a_lamp_on_or_in_a_wall_stays_within_what_it_carries(
    device: Device, position: tuple[float, float, float], kind: str
) -> None:
    """Its lights shine through walls all the same: that is the technique's known bias."""
    room = furnished(replace(POINT_LAMP, kind=kind, position=position))
    frame = rendered(device, room)
    most = np.sum([wave.irradiance.sum(axis=0) for wave in waves_of(room, ANGLE)], axis=0)
    assert np.isfinite(frame.images["irradiance"]).all()
    assert (frame.images["irradiance"] <= most * (1.0 + 1e-5)).all()


@pytest.mark.parametrize("angle", [90.0, 30.0, 5.0])
@pytest.mark.parametrize("computed_at", ["corners", "pixels"])
def test_no_point_receives_more_than_its_lamps_carry(device: Device, angle: float, computed_at: str) -> None:
    """Lights that touch a surface too: a light's distance plays no role."""
    (wave,) = waves_of(empty_room([SPOT_LAMP]), angle)
    touching = wave.positions[min(7, len(wave) - 1)]
    floor = quad(touching - (0.5, 0.5, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    room = empty_room([SPOT_LAMP])
    room = replace(room, meshes=(*room.meshes, floor))
    frame = rendered(device, room, angle=angle, computed_at=computed_at)
    carried = np.array(SPOT_LAMP.power) / (4.0 * math.pi) / wave.max_distance**2
    assert np.isfinite(frame.images["irradiance"]).all()
    assert (frame.images["irradiance"] <= carried).all()


def test_ten_lamps_at_once_are_the_sum_of_each(device: Device) -> None:
    random = np.random.default_rng(5)
    lamps = [
        replace(SPOT_LAMP, name=f"lamp {i}", power=tuple(random.uniform(5, 40, 3)), position=tuple(place))
        for i, place in enumerate(random.uniform((-1.8, -1.3, 0.2), (1.8, 1.3, 1.2), (10, 3)))
    ]
    settings = {"angle": 30.0, "maps": 3, "map_scale": 3.0}
    together = rendered(device, furnished(*lamps), **settings)
    alone = sum(rendered(device, furnished(lamp), **settings).images["irradiance"].astype(float) for lamp in lamps)
    assert together.counters["waves"] == 10
    np.testing.assert_allclose(together.images["irradiance"], alone, rtol=1e-4, atol=1e-6)


def test_a_lamp_switched_off_between_frames_leaves_nothing(device: Device) -> None:
    rendered(device, furnished(SPOT_LAMP, POINT_LAMP))
    after = rendered(device, furnished(POINT_LAMP))
    assert same(after, fresh(furnished(POINT_LAMP)))


def test_the_same_input_gives_the_same_bits_with_samples_and_chance(device: Device) -> None:
    first, second = (rendered(device, furnished(SPOT_LAMP), samples=3, active=0.3) for _ in range(2))
    assert same(first, second)
    assert first.counters["virtual_point_lights"] == round(0.3 * light_count(ANGLE, 5))


def test_walls_lend_no_colour(device: Device) -> None:
    """The technique's known bias: nothing bounces."""
    colored, grey = (
        rendered(device, empty_room([SPOT_LAMP], colors)) for colors in (((0.9, 0.1, 0.1),), ((0.2,) * 3,))
    )
    assert (colored.images["irradiance"] == grey.images["irradiance"]).all()


def glossy(roughness: float) -> SceneSnapshot:
    room = empty_room([SPOT_LAMP])
    return replace(room, materials=(Material("black", PRINCIPLED, (0.0, 0.0, 0.0), roughness=roughness),) * 6)


def test_the_specular_term_is_the_layers_brdf_summed_over_the_lights_without_attenuation(device: Device) -> None:
    room = glossy(1.0)
    frame = rendered(device, room, angle=45.0, computed_at="pixels", shadows="none")
    (wave,) = waves_of(room, 45.0)
    points, normals = seen(frame)
    assert room.camera is not None
    towards = wave.positions[None] - points[:, None]
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    to_view = room.camera.matrix_world[:3, 3] - points
    to_view /= np.linalg.norm(to_view, axis=1, keepdims=True)
    values = (np.zeros(3), 0.0, 1.0, 1.5, 0.5)
    brdf = principled_brdf(normals[:, None], towards, to_view[:, None], *values)[..., 0]
    cosines = np.maximum(np.einsum("pnk,pk->pn", towards, normals), 0.0)
    expected = (brdf * cosines) @ wave.specular_irradiance
    found = frame.images["lightwave_specular"].reshape(-1, 3)
    assert expected.max() > 0.0
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=1e-3 * expected.max())
    combined = frame.images["combined"][..., :3] - frame.images["direct"] - frame.images["indirect"]
    np.testing.assert_allclose(combined, frame.images["lightwave_specular"], atol=1e-5)


@pytest.mark.parametrize("computed_at", ["corners", "pixels"])
def test_mirrors_stay_finite_and_the_term_can_be_left_out(device: Device, computed_at: str) -> None:
    frame = rendered(device, glossy(0.0), computed_at=computed_at)
    assert np.isfinite(frame.images["combined"]).all()
    assert frame.images["lightwave_specular"].max() > 0.0
    without = rendered(device, glossy(0.0), computed_at=computed_at, specular=False)
    assert "lightwave_specular" not in without.images


def test_maps_that_need_too_much_memory_get_smaller_and_say_so(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wave_shadows, "MOST_MAP_BYTES", 8 * 4 * WIDTH * HEIGHT)
    frame = rendered(device, furnished(SPOT_LAMP), map_scale=3.0)
    assert frame.counters["indirect_shadow_map_bytes"] == 8 * 4 * WIDTH * HEIGHT
    assert any("1.00 times" in reason for reason in frame.reasons)


def test_more_corners_than_pixels_are_told(device: Device) -> None:
    few, many = (
        device.render(furnished(SPOT_LAMP), None, RenderSettings(side, side, "lightwave", {"angle": 45.0}, 1, 32, 1))
        for side in (4, 16)
    )
    assert any("computed_at=pixels" in reason for reason in few.reasons)
    assert not many.reasons


def test_strength_multiplies_all_of_the_indirect_light(device: Device) -> None:
    once, twice = (rendered(device, glossy(0.5), strength=strength) for strength in (1.0, 2.0))
    for name in ("irradiance", "lightwave_specular"):
        np.testing.assert_allclose(twice.images[name], 2.0 * once.images[name], rtol=1e-5)


def test_lights_are_drawn_where_they_stand(device: Device) -> None:
    picture = rendered(device, furnished(SPOT_LAMP)).images["lightwave_lights"]
    assert picture.shape == (HEIGHT, WIDTH, 3)
    assert 0.01 < (picture.max(axis=2) == 1.0).mean() < 0.9
