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


def function(device: Device, expression: str, components: int = 1, **inputs: object) -> np.ndarray:
    """A function of plain numbers, of every combination of the inputs: (combinations,) or with components."""
    grids = np.meshgrid(*(np.asarray(values, np.float32) for values in inputs.values()), indexing="ij")
    columns = {name: grid.ravel() for name, grid in zip(inputs, grids, strict=True)}
    return evaluate(device, "lib/brdf.glsl", expression, columns, components).reshape(*grids[0].shape, -1)


def of_all(*inputs: object) -> list[np.ndarray]:
    """float64 grids of the numbers that `function` rounds to float32, with an axis for components."""
    grids = np.meshgrid(*(np.asarray(values, np.float32).astype(float) for values in inputs), indexing="ij")
    return [grid[..., None] for grid in grids]


IORS = (1e-6, 0.5, 0.999, 1.0, 1.0001, 1.01, 1.33, 1.5, 2.5, 19.0, 1000.0)
COSINES = (0.0, 1e-20, 1e-6, 1e-3, 0.1, 0.5, 0.9, 1.0)
ALPHAS = (1e-4, 1e-2, 0.25, 1.0)


def test_f0_against_the_oracle(device: Device) -> None:
    found = function(device, "f0_from_ior(ior)", ior=IORS)
    np.testing.assert_allclose(found, brdf.f0_from_ior(*of_all(IORS)), rtol=1e-5, atol=1e-12)


def test_specular_ior_against_the_oracle(device: Device) -> None:
    levels = (-1.0, 0.0, 0.1, 0.5, 0.9, 1.0, 1e6)
    found = function(device, "specular_ior(ior, level)", ior=(0.0, *IORS), level=levels)
    np.testing.assert_allclose(found, brdf.specular_ior(*of_all((0.0, *IORS), levels)), rtol=1e-4)


def test_fresnel_against_the_oracle(device: Device) -> None:
    found = function(device, "fresnel_dielectric(cosine, ior)", cosine=COSINES, ior=IORS)
    cosine, ior = of_all(COSINES, IORS)
    # At the very angle of total reflection the rounding of one side or the other decides.
    decided = np.abs(ior * ior - 1.0 + cosine * cosine) > 1e-5
    assert decided.mean() > 0.8
    expected = brdf.fresnel_dielectric(cosine, ior)
    np.testing.assert_allclose(found[decided], expected[decided], rtol=2e-4, atol=1e-6)
    assert ((found >= 0.0) & (found <= 1.0)).all()


def test_mean_fresnel_against_the_oracle(device: Device) -> None:
    found = function(device, "fresnel_dielectric_mean(ior)", ior=IORS)
    np.testing.assert_allclose(found, brdf.fresnel_dielectric_average(*of_all(IORS)), rtol=1e-5, atol=1e-7)
    assert ((found >= 0.0) & (found <= 1.0)).all()


def test_scattering_gain_against_its_definition(device: Device) -> None:
    shares = (0.0, 1e-6, 0.3, 0.9, 1.0)
    found = function(device, "scattering_gain(albedo, mean, vec3(f)).x", albedo=shares, mean=shares, f=shares)
    assert np.isfinite(found).all()
    assert (found >= 1.0).all()
    albedo, mean, fresnel = of_all(shares[2:], shares[2:], shares)
    expected = 1.0 + fresnel * mean / (1.0 - fresnel * (1.0 - mean)) * (1.0 - albedo) / albedo
    np.testing.assert_allclose(found[2:, 2:], expected, rtol=1e-5)


def test_ggx_lobe_against_the_oracle(device: Device) -> None:
    cosines = (1e-3, 0.1, 0.5, 0.9, 1.0)
    found = function(device, "ggx_lobe(h, l, v, alpha)", h=cosines, l=cosines, v=cosines, alpha=ALPHAS)
    half, light, view, alpha = of_all(cosines, cosines, cosines, ALPHAS)
    expected = brdf.ggx_brdf(half, light, view, np.sqrt(alpha)) * light
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_ggx_lobe_of_a_sine_keeps_its_digits_next_to_the_peak(device: Device) -> None:
    """Where the cosine of the half vector rounds to 1."""
    sines = (0.0, 1e-8, 1e-5, 0.3)
    found = function(device, "ggx_lobe_of_sine(s * s, 0.7, 0.4, alpha)", s=sines, alpha=ALPHAS)
    sine, alpha = of_all(sines, ALPHAS)
    denominator = alpha**2 + sine**2 * (1.0 - alpha**2)
    part = 0.7 * np.sqrt(0.16 * (1 - alpha**2) + alpha**2) + 0.4 * np.sqrt(0.49 * (1 - alpha**2) + alpha**2)
    np.testing.assert_allclose(found, alpha**2 / np.pi / denominator**2 * 0.35 / part, rtol=1e-5)


def test_ggx_lobe_stays_finite_at_its_ends(device: Device) -> None:
    found = function(device, "ggx_lobe(h, l, v, alpha)", h=COSINES, l=COSINES, v=COSINES, alpha=(0.0, 1e-20, *ALPHAS))
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()


def test_table_is_read_at_its_own_points(device: Device) -> None:
    table = brdf.albedo_table().astype(float)
    steps = np.linspace(0.0, 1.0, brdf.ALBEDO_TABLE_SIZE)
    fresnel, cosine, roughness = (grid.ravel() for grid in np.meshgrid(steps, steps, steps, indexing="ij"))
    inputs = {"f0": fresnel**4, "cosine": cosine**2, "roughness": roughness}
    found = call(device, "lookup_albedo(albedo_table, f0, cosine, roughness)", inputs, 4)
    np.testing.assert_allclose(found, table.reshape(-1, 4), atol=2e-3)
    beyond = {"f0": np.full(4, 0.5), "cosine": np.array([-1.0, 2.0, 0, 0]), "roughness": np.array([0, 0, -1.0, 2.0])}
    assert np.isfinite(call(device, "lookup_albedo(albedo_table, f0, cosine, roughness)", beyond, 4)).all()


EXTREMES = {
    "smooth": {"roughness": 0.0},
    "rough": {"roughness": 1.0},
    "no interface": {"ior": 1.0, "level": 0.5},
    "thin air": {"ior": 1e-6, "level": 0.5},
    "diamond": {"ior": 1000.0, "level": 1e6},
    "metal": {"metallic": 1.0},
    "mirror": {"metallic": 1.0, "roughness": 0.0},
}


@pytest.mark.parametrize("color", [0.0, 1.0, 1e6])
@pytest.mark.parametrize("name", EXTREMES)
def test_extreme_surfaces_reflect_finite_light(device: Device, name: str, color: float) -> None:
    """The light and the eye at every height down to none, in one place, across, and as in a mirror."""
    cosines = np.array([1.0, 0.5, 1e-3, 1e-7, 1e-20, 0.0])
    light, view, turn = (g.ravel() for g in np.meshgrid(cosines, cosines, [0.0, 0.5 * np.pi, np.pi], indexing="ij"))
    count = len(light)
    side = [np.sqrt(1.0 - c * c) for c in (light, view)]
    values = {"metallic": 0.0, "roughness": 0.5, "ior": 1.5, "level": 0.5} | EXTREMES[name]
    inputs = {key: np.full(count, value) for key, value in values.items()}
    inputs["n"] = np.tile([0.0, 0.0, 1.0], (count, 1))
    inputs["l"] = np.stack([side[0], np.zeros(count), light], axis=1)
    inputs["v"] = np.stack([side[1] * np.cos(turn), side[1] * np.sin(turn), view], axis=1)
    inputs["color"] = np.full((count, 3), color)
    inputs = {key: np.asarray(array, np.float32) for key, array in inputs.items()}
    values = brdf_of(device, inputs, "PRINCIPLED")
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()
    albedo = call(device, f"diffuse_albedo({SURFACE.format(model='PRINCIPLED')}, v)", inputs)
    assert (albedo >= 0.0).all()
    assert (albedo <= color).all()


def test_wider_light_blurs_the_lobe_and_mirrorless_surfaces_stay_so(device: Device) -> None:
    angles = np.array([0.0, 1e-3, 0.1, 10.0])
    widened = call(device, "widened_alpha(alpha, angle)", {"alpha": np.full(4, 0.04), "angle": angles}, 1)
    assert widened[0] == pytest.approx(0.04)
    assert (np.diff(widened) > 0.0).all()
    assert widened[-1] <= 1.0
    assert not call(device, "widened_alpha(alpha, angle)", {"alpha": np.zeros(4), "angle": angles}, 1).any()


def test_lobe_fresnel_mixes_a_metal_and_a_dielectric(device: Device) -> None:
    """With known weights: Schlick's metal of F0 0.3, and the interface of each index."""
    iors, cosines = of_all(IORS, COSINES)
    reflector = "Reflector(vec3(0.0), vec3(0.3), vec3(0.25), 0.75, ior, 0.1)"
    found = function(device, f"lobe_fresnel({reflector}, cosine).x", ior=IORS, cosine=COSINES)
    metal = 0.3 + 0.7 * (1.0 - cosines) ** 5
    decided = np.abs(iors * iors - 1.0 + cosines * cosines) > 1e-5
    expected = 0.25 * metal + 0.75 * brdf.fresnel_dielectric(cosines, iors)
    np.testing.assert_allclose(found[decided], expected[decided], rtol=2e-4, atol=1e-6)
