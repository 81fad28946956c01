# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/lights.glsl` against the float64 oracle in core/lamps.py."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core import lamps
from vlm_addon.core.scene import AREA, ELLIPSE, POINT, SPOT, SUN, Light
from vlm_addon.render.device import Device
from vlm_addon.render.gpu_layout import LAMP
from vlm_addon.render.lamp_records import lamp_record

COUNT = 500
TILTED = {
    "x_axis": (0.8, 0.0, 0.6),
    "y_axis": (0.0, 1.0, 0.0),
    "z_axis": (-0.6, 0.0, 0.8),
}
BASE = Light("lamp", POINT, (10.0, 20.0, 30.0), (0.5, -0.25, 2.0), **TILTED)
LAMPS = {
    "point": BASE,
    "soft point": replace(BASE, radius=0.7),
    "ball": replace(BASE, radius=0.7, soft_falloff=False),
    "spot": replace(BASE, kind=SPOT, spot_angle=1.4, spot_blend=0.3),
    "spot without blend": replace(BASE, kind=SPOT, spot_angle=1.4, spot_blend=0.0),
    "squashed spot": replace(BASE, kind=SPOT, spot_angle=1.4, spot_blend=1.0, spot_scale=(2.0, 0.5)),
    "sun": replace(BASE, kind=SUN),
    "soft sun": replace(BASE, kind=SUN, angle=0.8),
    "rectangle": replace(BASE, kind=AREA, size_x=2.0, size_y=0.5),
    "tiny rectangle": replace(BASE, kind=AREA, size_x=0.001, size_y=0.002),
    "ellipse": replace(BASE, kind=AREA, size_x=2.0, size_y=0.5, shape=ELLIPSE),
}


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def lamp_literal(light: Light, sample: lamps.LampSample) -> str:
    """GLSL that makes the Lamp of a sample."""
    record = lamp_record(light, sample, np.zeros(3))[0]

    def text(name: str, glsl_type: str) -> str:
        values = np.atleast_1d(record[name])
        if glsl_type == "int":
            return str(int(values[0]))
        numbers = ", ".join(f"{float(value):.9e}" for value in values)
        return numbers if glsl_type == "float" else f"{glsl_type}({numbers})"

    return "Lamp(" + ", ".join(text(name, glsl_type) for glsl_type, name in LAMP.fields) + ")"


def shader(device: Device, light: Light, points: np.ndarray, normals: np.ndarray, samples: int) -> np.ndarray:
    total = np.zeros((len(points), 3))
    for sample in lamps.lamp_samples(light, samples):
        call = f"lamp_irradiance({lamp_literal(light, sample)}, p, n)"
        inputs = {"p": points, "n": normals}
        total += sample.share * evaluate(device, "lib/lights.glsl", call, inputs, components=3)
    return total


def random_receivers() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    return random.uniform(-3.0, 3.0, (COUNT, 3)), unit(random.normal(size=(COUNT, 3)))


@pytest.mark.parametrize("name", list(LAMPS))
def test_irradiance_against_the_oracle(device: Device, name: str) -> None:
    points, normals = random_receivers()
    light = LAMPS[name]
    found = shader(device, light, points, normals, 9 if light.kind == AREA else 1)
    expected = lamps.lamp_irradiance(light, points, normals)
    # 64 cells of the oracle's ellipse and 9 of the shader's differ in outline.
    relative, absolute = (0.02, 1e-2) if name == "ellipse" else (2e-4, 2e-6)
    np.testing.assert_allclose(found, expected, rtol=relative, atol=absolute * expected.max())


@pytest.mark.parametrize("count", [1, 3, 16])
def test_samples_of_a_rectangle_sum_to_the_whole(device: Device, count: int) -> None:
    points, normals = random_receivers()
    found = shader(device, LAMPS["rectangle"], points, normals, count)
    expected = lamps.lamp_irradiance(LAMPS["rectangle"], points, normals)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=2e-6 * expected.max())


@pytest.mark.parametrize("sine", [0.0, 0.01, 0.029, 0.031, 0.3, 0.999])
def test_horizon_cosine(device: Device, sine: float) -> None:
    cosines = np.linspace(-1.0, 1.0, 2001)
    inputs = {"c": cosines, "s": np.full(2001, sine)}
    found = evaluate(device, "lib/lights.glsl", "horizon_cosine(c, s)", inputs)
    expected = lamps.horizon_cosine(cosines.astype(np.float32), np.full(2001, sine, np.float32))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-4 * max(sine, 0.01))


@pytest.mark.parametrize("x", [-1.0, 1.0])
def test_arctangent_over_the_half_circle(device: Device, x: float) -> None:
    y = np.concatenate([np.linspace(0.0, 2.0, 1001), [1e-20, 1e20]])
    inputs = {"y": y, "x": np.full(len(y), x)}
    found = evaluate(device, "lib/lights.glsl", "half_circle_arctangent(y, x)", inputs)
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=0.0, atol=6e-7)


@pytest.mark.parametrize("name", list(LAMPS))
def test_nothing_breaks_at_the_lamp_itself(device: Device, name: str) -> None:
    light = LAMPS[name]
    points = np.array([light.position, np.array(light.position) + 1e-7, np.array(light.position) * (1 + 1e-6)])
    values = shader(device, light, points, np.tile([0.0, 0.0, 1.0], (3, 1)), 1)
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()


def ray(device: Device, light: Light, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over 4 samples of the irradiance on a surface facing each sample, and of its solid angle."""
    irradiance, angle = np.zeros((len(points), 3)), np.zeros(len(points))
    samples = lamps.lamp_samples(light, 4)
    for sample in samples:
        call = f"lamp_ray({lamp_literal(light, sample)}, p)"
        call = f"vec4({call}.irradiance, {call}.solid_angle)"
        values = evaluate(device, "lib/lights.glsl", call, {"p": points}, components=4)
        irradiance += sample.share * values[:, :3]
        angle += values[:, 3]
    return irradiance, angle


@pytest.mark.parametrize("name", ["point", "ball", "soft point", "sun", "rectangle", "ellipse"])
def test_ray_brings_the_irradiance_of_a_facing_surface(device: Device, name: str) -> None:
    """Far from the lamp, where all of its points lie in one direction."""
    light = LAMPS[name]
    direction = np.array([0.6, 0.3, -0.8]) / np.linalg.norm([0.6, 0.3, -0.8])
    points = np.array(light.position) + 40.0 * direction[None]
    to_lamp = np.array([light.z_axis]) if light.kind == SUN else -direction[None]
    irradiance, _ = ray(device, light, points)
    np.testing.assert_allclose(irradiance, lamps.lamp_irradiance(light, points, to_lamp), rtol=2e-3)


def test_solid_angles_of_the_samples_make_up_the_lamp(device: Device) -> None:
    light = LAMPS["rectangle"]
    points = np.array(light.position) - 40.0 * np.array([light.z_axis])
    _, angle = ray(device, light, points)
    assert angle[0] == pytest.approx(1.0 / 40.0**2, rel=1e-3)
    _, angle = ray(device, LAMPS["ball"], points)
    assert angle[0] == pytest.approx(math.pi * 0.49 / 40.0**2, rel=1e-3)
