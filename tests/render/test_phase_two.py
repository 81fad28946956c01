# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance from virtual lights against the float64 form factor, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import room
from tests.render.pixels import Pixels, expected, radiosity_rows, random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.light_mesh import VirtualLightMesh, empty_light_mesh
from vlm_addon.core.progress import Progress, silent
from vlm_addon.core.scene import Float32, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.passes import phase_two
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.phase_two import PhaseTwoPass
from vlm_addon.render.virtual_lights import GpuVirtualLights


def irradiance(
    device: Device,
    pixels: Pixels,
    lights: VirtualLightMesh,
    radiosity: Float32,
    origin: Float64 | None = None,
    progress: Progress = silent,
) -> Float32:
    """(h, w, 4) of the pass, row 0 at the top."""
    height, width = pixels.shown.shape
    with device.current() as context:
        buffer = context.buffer(radiosity_rows(radiosity))
        records = GpuVirtualLights(context, lights, np.zeros(3) if origin is None else origin)
        found = PhaseTwoPass(context, device.shaders, width, height).render(
            pixels.gbuffer(device), records, buffer, progress
        )
        return read_image(found)


@pytest.mark.parametrize("size", [1.0, 0.2, 0.02], ids=["large", "middle", "small and far"])
def test_random_lights_give_what_the_closed_form_gives(device: Device, size: float) -> None:
    generator = np.random.default_rng(int(100 * size))
    pixels, lights = Pixels(generator), random_lights(generator, 150, size)
    radiosity = generator.uniform(0.0, 10.0, (150, 3)).astype(np.float32)
    truth = expected(pixels, lights, radiosity)
    found = irradiance(device, pixels, lights, radiosity)[..., :3]
    assert found == pytest.approx(truth, rel=2e-4, abs=2e-5 * truth.max())


@pytest.mark.parametrize("size", [0.3, 0.05, 0.005], ids=["large", "middle", "small and far"])
@pytest.mark.parametrize("curvature", [0.0, 0.3, 3.0], ids=["flat", "bent", "strongly bent"])
def test_neighbouring_pixels_of_one_surface_give_the_same(device: Device, curvature: float, size: float) -> None:
    """Where a whole tile of pixels treats a light alike; a hole in the surface and lights in its plane included."""
    generator = np.random.default_rng(4)
    side, count = 48, 200
    pixels, lights = Pixels(generator, (side, side)), random_lights(generator, count, size)
    grid = np.linspace(-1.0, 1.0, side, dtype=np.float32)
    x, y = np.meshgrid(grid, grid)
    pixels.positions = np.stack([x, y, -0.5 * np.float32(curvature) * (x * x + y * y)], axis=2)
    normals = np.stack([curvature * x, curvature * y, np.ones_like(x)], axis=2)
    pixels.normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)
    pixels.shown = np.hypot(x - 0.2, y) > 0.3
    lights.vertices[: 3 * count // 4, 2] = 0.0
    radiosity = generator.uniform(0.0, 10.0, (count, 3)).astype(np.float32)
    truth = expected(pixels, lights, radiosity)
    found = irradiance(device, pixels, lights, radiosity)[..., :3]
    assert found == pytest.approx(truth, rel=2e-4, abs=2e-5 * truth.max())


def test_closed_room_of_many_lights_fills_the_hemisphere(device: Device) -> None:
    """120,000 lights of radiosity 1 around every pixel give irradiance 1: none is lost, and sums keep their digits."""
    generator = np.random.default_rng(2)
    pixels, lights = Pixels(generator, (4, 4)), lights_from_triangles(room(100).astype(np.float32))
    pixels.positions = generator.uniform(1e-3, 1.0 - 1e-3, pixels.positions.shape).astype(np.float32)
    found = irradiance(device, pixels, lights, np.ones((len(lights), 3), np.float32))[pixels.shown, :3]
    assert found == pytest.approx(1.0, abs=1e-5)


def test_pixels_without_surface_stay_zero(device: Device) -> None:
    generator = np.random.default_rng(1)
    pixels, lights = Pixels(generator), random_lights(generator, 20, 0.5)
    found = irradiance(device, pixels, lights, np.ones((20, 3), np.float32))
    assert (found[~pixels.shown] == 0.0).all()
    assert (found[pixels.shown][:, :3].max(axis=0) > 0.0).all()


def test_a_tag_leaves_out_its_own_surfaces_and_no_others(device: Device) -> None:
    """One light over surfaces of the tags 0 to 3 that all see it alike."""
    generator = np.random.default_rng(2)
    pixels = Pixels(generator)
    pixels.positions[...] = 0.0
    pixels.normals[...] = (0.0, 0.0, 1.0)
    pixels.shown[...] = True
    corners = [[[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]]]
    for tag_id in (0, 1, 2):
        found = irradiance(device, pixels, lights_from_triangles(corners, tag_ids=tag_id), np.ones((1, 3), np.float32))
        excluded = (pixels.tag_ids == tag_id) & (tag_id != 0)
        assert (found[excluded][:, 0] == 0.0).all()
        assert (found[~excluded][:, 0] > 0.05).all()


def test_no_lights_give_no_light(device: Device) -> None:
    pixels = Pixels(np.random.default_rng(3))
    assert (irradiance(device, pixels, empty_light_mesh(), np.zeros((0, 3), np.float32)) == 0.0).all()


def test_the_split_into_dispatches_does_not_show(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(5)
    count = phase_two.MIN_LIGHTS_PER_DISPATCH * 3 + 7
    pixels, lights = Pixels(generator), random_lights(generator, count, 0.1)
    radiosity = generator.uniform(0.0, 10.0, (count, 3)).astype(np.float32)
    whole = irradiance(device, pixels, lights, radiosity)
    monkeypatch.setattr(phase_two, "EVALUATIONS_PER_DISPATCH", 1)
    calls: list[float] = []
    split = irradiance(device, pixels, lights, radiosity, progress=lambda f, label: calls.append(f) is None)
    assert len(calls) == 4
    assert calls[-1] == 1.0
    assert split == pytest.approx(whole, rel=1e-5, abs=1e-5)


def test_the_work_can_be_cancelled_between_dispatches(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phase_two, "EVALUATIONS_PER_DISPATCH", 1)
    generator = np.random.default_rng(6)
    count = phase_two.MIN_LIGHTS_PER_DISPATCH * 3
    calls: list[float] = []

    def second_time(fraction: float, label: str) -> bool:
        calls.append(fraction)
        return len(calls) < 2

    with pytest.raises(Cancelled):
        irradiance(
            device,
            Pixels(generator),
            random_lights(generator, count, 0.1),
            np.ones((count, 3), np.float32),
            progress=second_time,
        )
    assert len(calls) == 2


def test_lights_are_rounded_only_after_the_local_origin_is_taken_off(device: Device) -> None:
    generator = np.random.default_rng(7)
    pixels = Pixels(generator)
    corners = (
        (generator.uniform(-1, 1, (30, 1, 3)) + generator.normal(0, 0.2, (30, 3, 3))).astype(np.float32).astype(float)
    )
    origin = np.array([81920.5, -40960.25, 1024.125])
    radiosity = np.ones((30, 3), np.float32)
    near = irradiance(device, pixels, lights_from_triangles(corners), radiosity)
    far = irradiance(device, pixels, lights_from_triangles(corners + origin), radiosity, origin)
    assert far == pytest.approx(near, abs=1e-6)


def test_bright_lights_neither_overflow_nor_lose_their_hue(device: Device) -> None:
    pixels = Pixels(np.random.default_rng(8))
    lights = random_lights(np.random.default_rng(9), 5, 0.5)
    radiosity = np.tile(np.float32([1e6, 1.0, 1e-6]), (5, 1))
    found = irradiance(device, pixels, lights, radiosity)[..., :3]
    assert np.isfinite(found).all()
    scale = radiosity.max(axis=0)
    assert found / scale == pytest.approx(expected(pixels, lights, radiosity) / scale, rel=1e-3, abs=1e-6)


def test_the_same_input_gives_the_same_bits(device: Device) -> None:
    generator = np.random.default_rng(10)
    pixels, lights = Pixels(generator), random_lights(generator, 300, 0.1)
    radiosity = np.ones((300, 3), np.float32)
    first = irradiance(device, pixels, lights, radiosity)
    assert (first == irradiance(device, pixels, lights, radiosity)).all()
