# SPDX-License-Identifier: GPL-3.0-or-later
"""BRDFs against Monte Carlo over the hemisphere and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from vlm_addon.core import brdf
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import DIFFUSE, PRINCIPLED


def directions(count: int) -> np.ndarray:
    """Unit vectors spread over the upper hemisphere, uniform in solid angle."""
    i = np.arange(count) + 0.5
    z, phi = i / count, np.pi * (1.0 + 5.0**0.5) * i
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def view(cosine: float) -> np.ndarray:
    return np.array([np.sqrt(1.0 - cosine * cosine), 0.0, cosine])


def albedo_by_sum(cosine: float, **material: object) -> np.ndarray:
    lights = directions(60_000)
    values = brdf.principled_brdf(np.array([0.0, 0.0, 1.0]), lights, view(cosine), **material)
    return 2.0 * np.pi * (values * lights[:, 2:]).mean(axis=0)


def material(**changes: object) -> dict[str, object]:
    return {
        "base_color": np.array([0.8, 0.5, 0.2]),
        "metallic": 0.0,
        "roughness": 0.5,
        "ior": 1.5,
        "specular_ior_level": 0.5,
    } | changes


def test_fresnel_at_normal_incidence_and_grazing() -> None:
    assert brdf.fresnel_dielectric(1.0, 1.5) == pytest.approx(0.04, abs=1e-12)
    assert brdf.fresnel_dielectric(0.0, 1.5) == pytest.approx(1.0, abs=1e-12)


def test_fresnel_at_brewsters_angle_reflects_half_of_one_polarisation() -> None:
    ior = 1.5
    incident = np.arctan(ior)
    refracted = np.pi / 2 - incident
    s_polarised = np.sin(incident - refracted) ** 2 / np.sin(incident + refracted) ** 2
    assert brdf.fresnel_dielectric(np.cos(incident), ior) == pytest.approx(0.5 * s_polarised, rel=1e-12)


def test_total_internal_reflection() -> None:
    assert brdf.fresnel_dielectric(0.1, 1.0 / 1.5) == 1.0


@pytest.mark.parametrize("ior", [1.1, 1.5, 2.5, 0.7])
def test_mean_fresnel_against_the_integral(ior: float) -> None:
    cosine = (np.arange(10_000) + 0.5) / 10_000
    integral = (2.0 * cosine * brdf.fresnel_dielectric(cosine, ior)).mean()
    assert brdf.fresnel_dielectric_average(ior) == pytest.approx(integral, abs=6e-3)


def test_specular_level_of_half_keeps_the_index_and_zero_removes_the_layer() -> None:
    assert brdf.specular_ior(1.33, 0.5) == 1.33
    assert brdf.specular_ior(1.33, 0.0) == pytest.approx(1.0)
    assert brdf.f0_from_ior(brdf.specular_ior(1.5, 1.0)) == pytest.approx(0.08)


@pytest.mark.parametrize("roughness", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.2])
def test_dielectric_layer_albedo_against_summed_brdf(roughness: float, cosine: float) -> None:
    black = material(base_color=np.zeros(3), roughness=roughness)
    expected = albedo_by_sum(cosine, **black)[0]
    assert brdf.interface_albedo(1.5, cosine, roughness) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.2])
def test_white_metal_loses_no_light(roughness: float, cosine: float) -> None:
    white = material(base_color=np.ones(3), metallic=1.0, roughness=roughness)
    np.testing.assert_allclose(albedo_by_sum(cosine, **white), 1.0, atol=0.01)


@pytest.mark.parametrize("cosine", [1.0, 0.3])
def test_white_dielectric_loses_no_light(cosine: float) -> None:
    white = material(base_color=np.ones(3))
    np.testing.assert_allclose(albedo_by_sum(cosine, **white), 1.0, atol=0.005)


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_diffuse_reflectance_is_the_view_mean_of_the_base(roughness: float) -> None:
    cosines = (np.arange(64) + 0.5) / 64
    share = 1.0 - brdf.interface_albedo(1.5, cosines, roughness)
    expected = (2.0 * cosines * share).mean() * 0.8 * 0.75
    found = brdf.diffuse_reflectance([0.8, 0.8, 0.8], 0.25, 1.5, 0.5, roughness, PRINCIPLED)
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_diffuse_reflectance_of_diffuse_is_the_base_colour() -> None:
    colors = np.array([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]])
    np.testing.assert_array_equal(
        brdf.diffuse_reflectance(colors, 0.5, 1.5, 0.5, 0.5, DIFFUSE), colors.astype(np.float32)
    )


def test_diffuse_reflectance_broadcasts_textures_of_metallic_and_roughness() -> None:
    found = brdf.diffuse_reflectance(np.full((2, 4, 3), 0.5), np.zeros((2, 4)), 1.5, 0.5, np.full(4, 0.5), PRINCIPLED)
    assert found.shape == (2, 4, 3)
    assert found.dtype == np.float32


def test_diffuse_reflectance_refuses_an_unknown_model() -> None:
    with pytest.raises(InvalidInput, match="'GLASS' is not a shading model"):
        brdf.diffuse_reflectance([0.5] * 3, 0.0, 1.5, 0.5, 0.5, "GLASS")


def test_nothing_is_reflected_from_below_the_surface() -> None:
    n = np.array([0.0, 0.0, 1.0])
    below = np.array([0.6, 0.0, -0.8])
    above = np.array([0.6, 0.0, 0.8])
    assert not brdf.principled_brdf(n, below, above, **material()).any()
    assert not brdf.principled_brdf(n, above, below, **material()).any()


def test_reciprocity_of_the_metal() -> None:
    n, a, b = np.array([0.0, 0.0, 1.0]), view(0.9), np.array([0.0, 0.8, 0.6])
    single = brdf.ggx_brdf(0.95, 0.9, 0.6, 0.4)
    assert single == pytest.approx(float(brdf.ggx_brdf(0.95, 0.6, 0.9, 0.4)), rel=1e-12)
    there = brdf.principled_brdf(n, a, b, **material(metallic=1.0, roughness=0.3))
    back = brdf.principled_brdf(n, b, a, **material(metallic=1.0, roughness=0.3))
    # The multiple-scattering gain depends on the view alone, as in Cycles, so reciprocity holds only roughly.
    np.testing.assert_allclose(there, back, rtol=0.02)
