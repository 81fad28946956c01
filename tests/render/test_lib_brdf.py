# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/brdf.glsl` with its table bound against the float64 BRDF in core/brdf.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core import brdf
from vlm_addon.render.albedo_texture import AlbedoTexture
from vlm_addon.render.device import Device

COUNT = 500
SURFACE = "Surface(vec3(0.0), 1.0, n, n, color, vec3(0.0), roughness, metallic, level, ior, 0, 0, 0, MODEL_{model})"


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def case(**constants: float) -> dict[str, np.ndarray]:
    """Random directions above random normals, and materials with `constants` fixed."""
    random = np.random.default_rng(6)
    normals = unit(random.normal(size=(COUNT, 3)))
    above = [unit(normals + 0.95 * unit(random.normal(size=(COUNT, 3)))) for _ in range(2)]
    values = {
        "n": normals,
        "l": above[0],
        "v": above[1],
        "color": random.uniform(0.0, 1.0, (COUNT, 3)),
        "metallic": random.uniform(0.0, 1.0, COUNT),
        "roughness": random.uniform(0.2, 1.0, COUNT),
        "ior": random.uniform(1.1, 2.5, COUNT),
        "level": random.uniform(0.0, 1.0, COUNT),
    }
    return {name: np.asarray(v, np.float32) for name, v in (values | _filled(constants)).items()}


def _filled(constants: dict[str, float]) -> dict[str, np.ndarray]:
    return {name: np.full(COUNT, value) for name, value in constants.items()}


def call(device: Device, expression: str, inputs: dict[str, np.ndarray], components: int = 3) -> np.ndarray:
    with device.current() as context:
        AlbedoTexture(context).bind()
        return evaluate(device, "passes/reflectance.glsl", expression, inputs, components)


def brdf_of(device: Device, inputs: dict[str, np.ndarray], model: str) -> np.ndarray:
    """BRDF times the cosine of the light."""
    reflector = f"make_reflector({SURFACE.format(model=model)}, v, albedo_table)"
    specular = f"specular_reflection({reflector}, n, l, v)"
    return call(device, f"{reflector}.diffuse * INVERSE_PI * max(dot(n, l), 0.0) + {specular}", inputs)


def oracle(inputs: dict[str, np.ndarray]) -> np.ndarray:
    f = {name: values.astype(np.float64) for name, values in inputs.items()}
    f |= {name: unit(f[name]) for name in ("n", "l", "v")}
    value = brdf.principled_brdf(
        f["n"], f["l"], f["v"], f["color"], f["metallic"], f["roughness"], f["ior"], f["level"]
    )
    return value * np.maximum((f["n"] * f["l"]).sum(-1, keepdims=True), 0.0)


@pytest.mark.parametrize(
    "constants",
    [{}, {"metallic": 0.0}, {"metallic": 1.0}, {"level": 0.5, "ior": 1.5}, {"level": 0.0}, {"roughness": 1.0}],
    ids=["all", "dielectric", "metal", "default layer", "no layer", "rough"],
)
def test_principled_against_the_oracle(device: Device, constants: dict[str, float]) -> None:
    inputs = case(**constants)
    expected = oracle(inputs)
    # The texture unit interpolates the albedo table with 8 fractional bits.
    np.testing.assert_allclose(brdf_of(device, inputs, "PRINCIPLED"), expected, rtol=5e-3, atol=1e-4)


def test_diffuse_is_lambert(device: Device) -> None:
    inputs = case()
    cosines = np.maximum((inputs["n"].astype(float) * inputs["l"]).sum(-1, keepdims=True), 0.0)
    expected = inputs["color"] * cosines / np.pi
    np.testing.assert_allclose(brdf_of(device, inputs, "DIFFUSE"), expected, rtol=1e-5, atol=1e-7)


def test_diffuse_albedo_leaves_what_the_layer_does_not_reflect(device: Device) -> None:
    inputs = case(metallic=0.0)
    expression = f"diffuse_albedo({SURFACE.format(model='PRINCIPLED')}, v)"
    cosines = (inputs["n"].astype(float) * inputs["v"]).sum(-1)
    eta = brdf.specular_ior(inputs["ior"], inputs["level"])
    expected = inputs["color"] * (1.0 - brdf.interface_albedo(eta, cosines, inputs["roughness"]))[:, None]
    np.testing.assert_allclose(call(device, expression, inputs), expected, atol=3e-3)


def test_smooth_lobes_and_grazing_angles_stay_finite(device: Device) -> None:
    inputs = case(roughness=0.0, metallic=1.0)
    inputs["l"] = unit(2.0 * (inputs["n"] * inputs["v"]).sum(-1, keepdims=True) * inputs["n"] - inputs["v"])
    for k, cosine in enumerate((1e-3, 1e-6, 0.0)):
        tangent = unit(np.cross(inputs["n"][k], [0.3, 0.5, 0.7]))
        inputs["v"][k] = tangent + cosine * inputs["n"][k]
    values = brdf_of(device, inputs, "PRINCIPLED")
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()


def test_wider_light_blurs_the_lobe_and_mirrorless_surfaces_stay_so(device: Device) -> None:
    angles = np.array([0.0, 1e-3, 0.1, 10.0])
    widened = call(device, "widened_alpha(alpha, angle)", {"alpha": np.full(4, 0.04), "angle": angles}, 1)
    assert widened[0] == pytest.approx(0.04)
    assert (np.diff(widened) > 0.0).all()
    assert widened[-1] <= 1.0
    assert not call(device, "widened_alpha(alpha, angle)", {"alpha": np.zeros(4), "angle": angles}, 1).any()
