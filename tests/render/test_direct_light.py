# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiance of a lit plane against the float64 lamps and BRDF, pixel by pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import camera_at, quad
from vlm_addon.core.brdf import principled_brdf
from vlm_addon.core.lamps import lamp_irradiance, lamp_samples
from vlm_addon.core.scene import (
    AREA,
    DIFFUSE,
    ORTHOGRAPHIC,
    POINT,
    PRINCIPLED,
    SPOT,
    SUN,
    Camera,
    Float64,
    Light,
    Material,
    SceneSnapshot,
)
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.lamp_shadows import LampShadows
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.direct_light import DirectLightPass
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.view import make_view

WIDTH, HEIGHT = 24, 16
CAMERA = camera_at((0.0, -4.0, 2.5), (0.0, 0.0, 0.0))
FLOOR = quad((-6.0, -6.0, 0.0), (12.0, 0.0, 0.0), (0.0, 12.0, 0.0))
MATERIALS = {
    "diffuse": Material("m", DIFFUSE, (0.8, 0.5, 0.2)),
    "principled": Material("m", PRINCIPLED, (0.8, 0.5, 0.2)),
    "metal": Material("m", PRINCIPLED, (0.8, 0.5, 0.2), roughness=0.4, metallic=1.0),
}
SIDEWAYS = {"x_axis": (0.8, 0.0, -0.6), "y_axis": (0.0, 1.0, 0.0), "z_axis": (0.6, 0.0, 0.8)}
LAMPS = {
    "point": Light("l", POINT, (10.0, 20.0, 30.0), (0.5, 1.0, 1.5)),
    "spot": Light("l", SPOT, (10.0, 20.0, 30.0), (0.5, 1.0, 1.5), **SIDEWAYS, spot_angle=2.0, spot_blend=1.0),
    "sun": Light("l", SUN, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), **SIDEWAYS),
    "area": Light("l", AREA, (10.0, 20.0, 30.0), (0.5, 1.0, 1.5), **SIDEWAYS, size_x=1.0, size_y=0.5),
}

SOFT_POINTS = 64


def rendered(
    device: Device, lights: list[Light], material: Material, camera: Camera = CAMERA
) -> tuple[Float64, Float64, Float64]:
    """Radiance, position and unit direction to the eye of every pixel's centre."""
    snapshot = SceneSnapshot("scene", (FLOOR,), (material,), lights=tuple(lights), camera=camera)
    with device.current() as context:
        geometry = GpuGeometry(context, snapshot)
        view = make_view(camera, WIDTH, HEIGHT, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, WIDTH, HEIGHT).render(geometry, view, 0)
        shadows = LampShadows(context, device.shaders, geometry, snapshot.lights, 256)
        direct = DirectLightPass(context, device.shaders, WIDTH, HEIGHT)
        radiance = read_image(direct.render(gbuffer, shadows, view, 0, 1, SOFT_POINTS))[..., :3].astype(np.float64)
        position = read_image(gbuffer.position)[..., :3].astype(np.float64) + geometry.origin
    backward = camera.matrix_world[:3, 2]
    to_eye = camera.matrix_world[:3, 3] - position
    to_eye = to_eye / np.linalg.norm(to_eye, axis=2, keepdims=True)
    return radiance, position, np.broadcast_to(backward, to_eye.shape) if camera.kind == ORTHOGRAPHIC else to_eye


def expected_radiance(light: Light, material: Material, position: Float64, to_eye: Float64) -> Float64:
    """Mean over dense samples of a lamp of BRDF times irradiance on a surface facing each."""
    points = position.reshape(-1, 3)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    if material.model == DIFFUSE:
        return (lamp_irradiance(light, points, normals) * material.base_color / np.pi).reshape(position.shape)
    samples = lamp_samples(light, 900)
    total = np.zeros_like(points)
    for sample in samples:
        direction = np.tile(sample.position, (len(points), 1)) if light.kind == SUN else sample.position - points
        distance = np.linalg.norm(direction, axis=1, keepdims=True)
        direction = direction / distance
        if light.kind == AREA:
            facing = direction @ np.array(light.z_axis)
            arriving = np.maximum(facing, 0.0)[:, None] * np.array(light.power) / (np.pi * distance**2)
        else:
            arriving = lamp_irradiance(light, points, direction)
        constants = (material.metallic, material.roughness, material.ior, material.specular_ior_level)
        brdf = principled_brdf(normals, direction, to_eye.reshape(-1, 3), material.base_color, *constants)
        total += brdf * direction[:, 2:] * arriving / len(samples)
    return total.reshape(position.shape)


@pytest.mark.parametrize("material", list(MATERIALS))
@pytest.mark.parametrize("lamp", list(LAMPS))
def test_plane_reflects_each_lamp_as_the_oracle_says(device: Device, lamp: str, material: str) -> None:
    radiance, position, to_eye = rendered(device, [LAMPS[lamp]], MATERIALS[material])
    expected = expected_radiance(LAMPS[lamp], MATERIALS[material], position, to_eye)
    # Lobes are widened by the lamp's cells, and the albedo table is read with 8 bits between its entries.
    relative = {"diffuse": 1e-3, "principled": 0.02, "metal": 0.06}[material]
    np.testing.assert_allclose(radiance, expected, rtol=relative, atol=1e-4 * expected.max())


def test_orthographic_eye(device: Device) -> None:
    camera = replace(CAMERA, kind=ORTHOGRAPHIC, ortho_scale=4.0)
    radiance, position, to_eye = rendered(device, [LAMPS["point"]], MATERIALS["metal"], camera)
    expected = expected_radiance(LAMPS["point"], MATERIALS["metal"], position, to_eye)
    np.testing.assert_allclose(radiance, expected, rtol=0.02, atol=1e-4 * expected.max())


def test_lamps_add_up(device: Device) -> None:
    one, two, three = (LAMPS[name] for name in ("point", "area", "sun"))
    together = rendered(device, [one, two, three], MATERIALS["principled"])[0]
    apart = sum(rendered(device, [lamp], MATERIALS["principled"])[0] for lamp in (one, two, three))
    np.testing.assert_allclose(together, apart, rtol=1e-5)


def test_no_lamp_gives_black(device: Device) -> None:
    assert not rendered(device, [], MATERIALS["principled"])[0].any()


def test_back_of_the_floor_sees_no_lamp_above(device: Device) -> None:
    below = camera_at((0.0, -4.0, -2.5), (0.0, 0.0, 0.0))
    for lamp in LAMPS.values():
        assert not rendered(device, [lamp], MATERIALS["principled"], below)[0].any()


def test_one_picture_alone_has_enough_points_of_a_soft_lamp(device: Device) -> None:
    """A half plane between an area lamp and the floor: the penumbra of one picture has many levels."""
    shade = quad((0.0, -6.0, 0.75), (6.0, 0.0, 0.0), (0.0, 12.0, 0.0))
    light = replace(LAMPS["area"], position=(0.0, 0.0, 1.5), x_axis=(1.0, 0.0, 0.0), z_axis=(0.0, 0.0, 1.0))
    snapshot = SceneSnapshot("scene", (FLOOR, shade), (MATERIALS["diffuse"],), lights=(light,), camera=CAMERA)
    camera = camera_at((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), lens=12.0)
    with device.current() as context:
        geometry = GpuGeometry(context, snapshot)
        view = make_view(camera, 128, 8, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, 128, 8).render(geometry, view, 0)
        shadows = LampShadows(context, device.shaders, geometry, snapshot.lights, 512)
        direct = DirectLightPass(context, device.shaders, 128, 8)
        row = read_image(direct.render(gbuffer, shadows, view, 0, 1, SOFT_POINTS))[4, :, 0]
    steps = np.abs(np.diff(row)) / row.max()
    assert steps.max() < 6.0 / np.sqrt(SOFT_POINTS) / 4.0
    assert row.min() < 0.1 * row.max()


@pytest.mark.parametrize("material", list(MATERIALS))
@pytest.mark.parametrize("lamp", list(LAMPS))
def test_a_million_watts_are_a_million_times_one(device: Device, lamp: str, material: str) -> None:
    dim = rendered(device, [replace(LAMPS[lamp], power=(1.0, 1.0, 1.0))], MATERIALS[material])[0]
    bright = rendered(device, [replace(LAMPS[lamp], power=(1e6, 1e6, 1e6))], MATERIALS[material])[0]
    assert np.isfinite(bright).all()
    np.testing.assert_allclose(bright, 1e6 * dim, rtol=1e-5)


@pytest.mark.parametrize("extent", [0.0, 1e-6, 1e6])
@pytest.mark.parametrize("lamp", list(LAMPS))
def test_floor_through_the_middle_of_a_bright_lamp_stays_finite(device: Device, lamp: str, extent: float) -> None:
    """A lamp in the floor, of no, tiny and huge extent, its specular lobe at its narrowest."""
    light = replace(
        LAMPS[lamp], power=(1e6, 1e6, 1e6), position=(0.0, 0.0, 0.0), radius=extent, size_x=extent, size_y=extent
    )
    mirror = replace(MATERIALS["metal"], roughness=0.0)
    radiance = rendered(device, [light], mirror)[0]
    assert np.isfinite(radiance).all()
    assert (radiance >= 0.0).all()
