# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of a sun's shadow maps: small things before large ones get their shadows, without seam and flicker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import camera_at, lights_from_triangles, quad
from vlm_addon.core.scene import (
    DIFFUSE,
    ORTHOGRAPHIC,
    PERSPECTIVE,
    SUN,
    Camera,
    Float64,
    Light,
    Material,
    Mesh,
    SceneSnapshot,
)
from vlm_addon.render import shadow_windows
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.lamp_shadows import LampShadows
from vlm_addon.render.passes import direct_light
from vlm_addon.render.passes.distance_range import DistanceRange
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.phase_one import PhaseOnePass
from vlm_addon.render.shadow_windows import FADE, WHOLE_SCENE, same_window, sample_windows, view_windows
from vlm_addon.render.view import make_view

LOW, HIGH = np.full(3, -500.0), np.full(3, 500.0)
RADIUS = 500.0 * 3.0**0.5
SUN_DIRECTION = {"x_axis": (0.8, 0.0, -0.6), "y_axis": (0.0, 1.0, 0.0), "z_axis": (0.6, 0.0, 0.8)}
LAMP = Light("sun", SUN, (np.pi, np.pi, np.pi), (0.0, 0.0, 0.0), **SUN_DIRECTION)
WHITE = (Material("white", DIFFUSE, (1.0, 1.0, 1.0)),)
WIDTH, HEIGHT = 96, 72


def kilometre() -> Mesh:
    return quad((-500.0, -500.0, 0.0), (1000.0, 0.0, 0.0), (0.0, 1000.0, 0.0))


def fence(height: float, x: float = 0.0) -> Mesh:
    """A wall without thickness across the sun, its shadow 0.75 heights long, towards -x."""
    return quad((x, -10.0 * height, 0.0), (0.0, 20.0 * height, 0.0), (0.0, 0.0, height))


def snapshot(*meshes: Mesh, camera: Camera, light: Light = LAMP) -> SceneSnapshot:
    return SceneSnapshot("scene", meshes, WHITE, lights=(light,), camera=camera)


def above(height: float, x: float = 0.0, **values: object) -> Camera:
    """Looks straight down; the picture is 1.44 heights wide, x to the right."""
    return camera_at((x, 0.0, height), (x, 0.0, 0.0), lens=25.0, clip_start=1e-3 * height, **values)


def picture(device: Device, scene: SceneSnapshot, **values: int) -> Float64:
    chosen = RenderSettings(WIDTH, HEIGHT, "direct", **{"samples": 1, "shadow_resolution": 512, **values})
    return device.render(scene, None, chosen).images["direct"][..., 0].astype(float)


@pytest.mark.parametrize("distances", [(0.01, 900.0), (0.1, 0.2), (3.0, 30.0), (700.0, 800.0), (1e-9, 1e-3)])
def test_shares_of_the_windows_sum_to_one(distances: tuple[float, float]) -> None:
    view = make_view(above(2.0), WIDTH, HEIGHT, np.zeros(3))
    windows = view_windows(view, LOW, HIGH, *distances)
    d = np.geomspace(*distances, 2000)

    def fade(radius: float) -> Float64:
        t = np.clip((d / radius - FADE) / (1.0 - FADE), 0.0, 1.0)
        return t * t * (3.0 - 2.0 * t)

    shares = [
        (1.0 - (fade(w.outer) if np.isfinite(w.outer) else 0.0 * d)) * (fade(w.inner) if w.inner else 1.0)
        for w in windows
    ]
    np.testing.assert_allclose(sum(shares), 1.0, atol=1e-12)
    for share, window in zip(shares, windows, strict=True):
        assert share.max() > 0.0
        if window.window is not None:
            assert window.outer <= 2.0 * window.window.radius


@pytest.mark.parametrize("lens", [8.0, 25.0, 200.0])
def test_window_holds_what_it_is_looked_up_for(lens: float) -> None:
    camera = camera_at((30.0, -20.0, 5.0), (-1.0, 2.0, 0.0), lens=lens)
    view = make_view(camera, WIDTH, HEIGHT, np.zeros(3))
    random = np.random.default_rng(1)
    corners = np.linalg.inv(view.clip_from_local) @ np.vstack(
        [random.uniform(-1, 1, (2, 500)), np.zeros(500), np.ones(500)]
    )
    rays = (corners[:3] / corners[3]).T - view.position
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    for part in view_windows(view, LOW, HIGH, 1e-3, 1e3):
        if part.window is not None:
            points = view.position + part.outer * random.random((500, 1)) * rays
            distance = np.linalg.norm(points - part.window.centre, axis=1)
            assert (distance <= part.window.radius).all()


def test_ordinary_view_of_a_room_needs_one_map() -> None:
    view = make_view(camera_at((0.0, -3.0, 1.5), (0.0, 0.0, 1.0)), WIDTH, HEIGHT, np.zeros(3))
    windows = view_windows(view, np.array([-2.5, -3.0, 0.0]), np.array([2.5, 3.0, 3.0]), 1.8, 7.0)
    assert [part.window for part in windows] == [None]


@pytest.mark.parametrize("height", [0.002, 0.01, 0.1, 1.0, 10.0])
def test_fence_casts_its_shadow_on_a_kilometre_of_floor(device: Device, height: float) -> None:
    scene = snapshot(kilometre(), fence(height), camera=above(1.8 * height))
    row = picture(device, scene)[HEIGHT // 2]
    x = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * 1.44 * 1.8 * height
    dark, lit = (x < -0.05 * height) & (x > -0.7 * height), (x > 0.05 * height) | (x < -0.8 * height)
    np.testing.assert_allclose(row[dark], 0.0, atol=1e-3)
    np.testing.assert_allclose(row[lit], 0.8, rtol=1e-3)


def test_orthographic_view_of_a_small_thing(device: Device) -> None:
    camera = replace(above(1.0), kind=ORTHOGRAPHIC, ortho_scale=0.2)
    row = picture(device, snapshot(kilometre(), fence(0.1), camera=camera))[HEIGHT // 2]
    x = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * 0.2
    np.testing.assert_allclose(row[(x < -0.01) & (x > -0.065)], 0.0, atol=1e-3)
    np.testing.assert_allclose(row[(x > 0.01) | (x < -0.085)], 0.8, rtol=1e-3)


def along_the_floor(**values: object) -> Camera:
    """From centimetres to the horizon in one picture."""
    return camera_at((0.0, -0.05, 0.02), (0.0, 0.2, 0.0), lens=18.0, clip_start=1e-3, clip_end=2e3, **values)


@pytest.mark.parametrize("angle", [0.0, 0.01])
def test_no_seam_between_windows(device: Device, angle: float) -> None:
    """Bare floor from two centimetres to half a kilometre: every pixel is lit alike."""
    scene = snapshot(kilometre(), camera=along_the_floor(), light=replace(LAMP, angle=angle))
    image = picture(device, scene, samples=2)
    floor = image[HEIGHT // 2 :]
    np.testing.assert_allclose(floor, 0.8, rtol=2e-5)


def test_windows_that_are_left_out_change_nothing(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = snapshot(kilometre(), fence(0.03), fence(1.0, x=2.0), fence(30.0, x=-60.0), camera=along_the_floor())
    skipping = picture(device, scene)
    monkeypatch.setattr(direct_light.DistanceRange, "measure", lambda *_: (0.0, np.inf))
    np.testing.assert_allclose(picture(device, scene), skipping, rtol=1e-6)


def test_small_move_of_the_camera_moves_no_shadow(device: Device) -> None:
    """A thousandth of the distance to what it sees: dark stays dark, lit stays lit and edges change within a pixel."""

    def moved(step: float) -> Float64:
        camera = camera_at((step, -0.05 - step, 0.02 + step), (step, 0.2 - step, step), lens=18.0, clip_start=1e-3)
        return picture(device, snapshot(kilometre(), *(fence(0.003, 0.01 * i) for i in range(-8, 9)), camera=camera))

    before, after = moved(0.0), moved(2e-5)
    padded = np.pad(before, 1, mode="edge")
    near = np.stack([padded[i : i + HEIGHT, j : j + WIDTH] for i in range(3) for j in range(3)])
    inside = np.ptp(near, axis=0) < 1e-3
    assert inside.mean() > 0.2
    assert (np.abs(after - before)[inside] <= 0.02 * np.maximum(before, before.mean())[inside]).all()


def test_distances_to_what_shows(device: Device) -> None:
    camera = above(3.0)
    scene = snapshot(fence(0.5), quad((-0.5, -0.4, 0.0), (1.0, 0.0, 0.0), (0.0, 0.8, 0.0)), camera=camera)
    with device.current() as context:
        geometry = GpuGeometry(context, scene)
        view = make_view(camera, WIDTH, HEIGHT, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, WIDTH, HEIGHT).render(geometry, view, 0)
        nearest, farthest = DistanceRange(context, device.shaders).measure(gbuffer, view)
        empty = GBufferPass(context, device.shaders, 8, 8).render(
            geometry, make_view(camera_at((0, 0, 3), (0, 0, 6)), 8, 8, geometry.origin), 0
        )
        nothing = DistanceRange(context, device.shaders).measure(empty, view)
    assert nearest == pytest.approx(3.0, abs=0.01)
    assert farthest == pytest.approx((9.0 + 0.25 + 0.16) ** 0.5, abs=0.03)
    assert nothing == (np.inf, 0.0)


@pytest.mark.parametrize("kind", [PERSPECTIVE, ORTHOGRAPHIC])
def test_windows_in_another_space_are_the_same_from_every_space_they_come_from(kind: str) -> None:
    """Those of an eye in five spaces around it, with units that are no powers of two, taken into one."""
    still = (LOW + 0.3, HIGH + 0.3)
    found = []
    for step in range(5):
        origin, unit = np.array([3.1, -2.7, 0.4]) * step, 0.7 + 0.13 * step
        eye = (np.array([12.0, -7.0, 3.0]) - origin) / unit
        camera = camera_at(eye, eye + np.array([0.3, 1.0, -0.2]), kind=kind, ortho_scale=4.0 / unit)
        view = make_view(camera, WIDTH, HEIGHT, np.zeros(3))
        bounds = (LOW - origin) / unit, (HIGH - origin) / unit
        windows = [item.window for item in view_windows(view, *bounds, 2.0 / unit, 40.0 / unit) if item.window]
        found.append([same_window(window, bounds, still) for window in windows])
        for window, other in zip(windows, found[-1], strict=True):
            assert other.radius == pytest.approx(unit * window.radius)
            np.testing.assert_allclose(
                np.subtract(other.centre, 0.3), unit * np.array(window.centre) + origin, atol=1e-6
            )
    assert len(found[0]) >= 1
    assert all(windows == found[0] for windows in found)


def test_source_samples_of_a_room_need_one_map() -> None:
    points = np.random.default_rng(2).uniform(-2.0, 2.0, (500, 3))
    windows, indices = sample_windows(points, np.full(500, 0.05), np.full(3, -2.0), np.full(3, 2.0), 1024)
    assert windows == (None,)
    assert not indices.any()


def test_source_samples_get_the_window_that_holds_them() -> None:
    random = np.random.default_rng(3)
    centres = [(0.0, 0.0, 0.0), (300.0, 5.0, 0.0), (-200.0, 77.0, 3.0)]
    points = np.concatenate([random.normal(size=(200, 3)) * 0.01 + centre for centre in centres])
    spacings = np.repeat([1e-3, 1e-3, 0.0], 200)
    windows, indices = sample_windows(points, spacings, LOW, HIGH, 1024)
    assert (indices[400:] == WHOLE_SCENE).all()
    for index, window in enumerate(windows):
        held = indices == index
        if window is not None and held.any():
            assert 2.0 * window.radius / 1024 <= 2e-3
            assert (np.linalg.norm(points[held] - window.centre, axis=1) <= window.radius).all()
    assert (indices[:400] != WHOLE_SCENE).all()
    assert len(set(indices[:200])) == len(set(indices[200:400])) == 1


def test_many_small_lights_over_a_large_scene_stay_within_the_budget() -> None:
    points = np.random.default_rng(4).uniform(-500.0, 500.0, (2000, 3))
    windows, indices = sample_windows(points, np.full(2000, 1e-3), LOW, HIGH, 1024)
    assert len(windows) <= shadow_windows.MOST_OF_SAMPLES + 1
    assert indices.max() < len(windows)


@pytest.mark.parametrize("height", [0.002, 0.05, 1.0])
def test_small_virtual_lights_are_shadowed_by_small_things(device: Device, height: float) -> None:
    """Lights on both sides of a fence, measured at one point each, before a kilometre of floor."""
    x = np.concatenate([np.linspace(-0.65, -0.1, 40), np.linspace(0.1, 1.0, 40)]) * height
    size = 0.02 * height
    corners = [[(c, 0.0, 0.0), (c + size, 0.0, 0.0), (c, size, 0.0)] for c in x]
    lights = lights_from_triangles(corners, emission=0.0, colour=1.0)
    scene = snapshot(kilometre(), fence(height), camera=above(1.0))
    with device.current() as context:
        geometry = GpuGeometry(context, scene)
        shadows = LampShadows(context, device.shaders, geometry, scene.lights, 1024)
        found = PhaseOnePass(context, device.shaders).render(lights, geometry.origin, shadows, [0], 4)[:, 0]
    np.testing.assert_allclose(found[:40], 0.0, atol=1e-6)
    np.testing.assert_allclose(found[40:], 0.8 * np.pi, rtol=1e-4)
