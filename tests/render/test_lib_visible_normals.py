# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/visible_normals.glsl` against the GGX lobe of core/brdf.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core import brdf
from vlm_addon.core.halton import halton_points
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device

FILE = "lib/visible_normals.glsl"
COUNT = 4096
ROUGHNESSES = (0.1, 0.3, 0.6, 1.0)
COSINES = (0.05, 0.3, 0.7, 1.0)
NORMAL = np.array([0.48, -0.64, 0.6])


def view_at(cosine: float) -> Float64:
    """A direction at this cosine to NORMAL."""
    across = np.cross(NORMAL, [0.2, 0.9, -0.1])
    return cosine * NORMAL + np.sqrt(1.0 - cosine * cosine) * across / np.linalg.norm(across)


def half_vectors(device: Device, view: Float64, roughness: float) -> Float64:
    """(COUNT, 3): of evenly spread numbers."""
    rows = {"n": np.tile(NORMAL, (COUNT, 1)), "v": np.tile(view, (COUNT, 1)), "u": halton_points(COUNT, first=1)}
    rows["alpha"] = np.full(COUNT, roughness**2)
    return evaluate(device, FILE, "visible_normal(n, v, alpha, u)", rows, 3).astype(float)


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_what_samples_carry_is_the_albedo_of_the_lobe(device: Device, roughness: float, cosine: float) -> None:
    """Integral of the lobe over all directions by the quadrature of core/brdf.py."""
    view = view_at(cosine)
    half = half_vectors(device, view, roughness)
    light = 2.0 * (half @ view)[:, None] * half - view
    inputs = {"h": half @ NORMAL, "l": np.maximum(light @ NORMAL, 0.0)}
    inputs |= {"v": np.full(COUNT, cosine), "a": np.full(COUNT, roughness**2)}
    carried = evaluate(device, [FILE, "lib/brdf.glsl"], "ggx_lobe(h, l, v, a) / reflection_density(h, v, a)", inputs)
    _, weights = brdf._visible_normal_quadrature(roughness**2, cosine)
    assert carried.mean() == pytest.approx(weights.sum(), abs=4e-3)


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_half_vectors_are_as_dense_as_the_view_sees_them(device: Device, roughness: float, cosine: float) -> None:
    """Mean of three functions of the half vector against sums over a grid of the sphere (Heitz 2014, eq. 16)."""
    alpha, view = roughness**2, view_at(cosine)
    height = (np.arange(2000) + 0.5) / 2000
    turn = (np.arange(200) + 0.5) / 200 * 2.0 * np.pi
    z, angle = np.meshgrid(height, turn, indexing="ij")
    across = view - cosine * NORMAL
    tangent = across / np.linalg.norm(across) if cosine < 1.0 else np.cross(NORMAL, [0.0, 0.6, 0.8])
    tangent /= np.linalg.norm(tangent)
    frame = np.stack([tangent, np.cross(NORMAL, tangent), NORMAL])
    radius = np.sqrt(1.0 - z * z)
    half = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1) @ frame
    density = alpha**2 / (np.pi * (1.0 - (1.0 - alpha**2) * z * z) ** 2)
    density = density * np.maximum(half @ view, 0.0)
    density /= density.sum()
    found = half_vectors(device, view, roughness)
    for function in (lambda h: h @ NORMAL, lambda h: h @ view, lambda h: (h @ tangent) ** 2):
        assert function(found).mean() == pytest.approx((density * function(half)).sum(), abs=6e-3)


def test_ends_stay_finite_unit_and_above(device: Device) -> None:
    cosines = [1.0, 1e-3, 1e-7, 0.0, -0.2]
    numbers = [0.0, 0.5, 1.0 - 2.0**-24]
    alphas = [1e-8, 1e-4, 0.5, 1.0]
    c, x, y, a = (g.ravel() for g in np.meshgrid(cosines, numbers, numbers, alphas, indexing="ij"))
    view = np.array([view_at(value) for value in c])
    rows = {"n": np.tile(NORMAL, (len(c), 1)), "v": view, "u": np.stack([x, y], axis=1), "a": a}
    found = evaluate(device, FILE, "visible_normal(n, v, a, u)", rows, 3).astype(float)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-5)
    assert (found @ NORMAL >= -1e-6).all()


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_density_is_that_of_half_vectors_turned_into_directions(
    device: Device, roughness: float, cosine: float
) -> None:
    """Distribution of normals that the view sees, by the cosine to the view and the four that reflection spreads."""
    cos_half = np.linspace(0.2, 1.0, 200)
    inputs = {"h": cos_half, "v": np.full(200, cosine), "a": np.full(200, roughness**2)}
    found = evaluate(device, FILE, "reflection_density(h, v, a)", inputs)
    alpha = roughness**2
    distribution = alpha**2 / (np.pi * (1.0 - (1.0 - alpha**2) * cos_half**2) ** 2)
    masking = 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)))
    np.testing.assert_allclose(found, distribution * masking / (4.0 * cosine), rtol=1e-3)


def test_density_stays_finite_at_its_ends(device: Device) -> None:
    half, view, alpha = (g.ravel() for g in np.meshgrid([0.0, 0.5, 1.0], [0.0, 1e-20, 1.0], [0.0, 1e-8, 1e-4, 1.0]))
    found = evaluate(device, FILE, "reflection_density(h, v, a)", {"h": half, "v": view, "a": alpha})
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
