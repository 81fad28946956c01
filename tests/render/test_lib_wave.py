# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/wave.glsl` against core/stacked_hemispheres.py and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.stacked_hemispheres import emission_share
from vlm_addon.render.device import Device

FILE = "lib/wave.glsl"


def test_emission_is_that_of_the_core(device: Device) -> None:
    cosines = np.linspace(-1.0, 1.0, 201, dtype=np.float32)
    found = evaluate(device, FILE, "emission_share(c)", {"c": cosines})
    np.testing.assert_allclose(found, emission_share(cosines), atol=1e-6)


def test_directions_are_unit_and_zero_where_the_point_touches_the_light(device: Device) -> None:
    random = np.random.default_rng(0)
    offsets = random.normal(size=(100, 3)) * 10.0 ** random.uniform(-6.0, 6.0, (100, 1))
    inputs = {"p": np.zeros((101, 3)), "q": np.concatenate([offsets, np.zeros((1, 3))])}
    found = evaluate(device, FILE, "towards_light(p, q)", inputs, 3)
    np.testing.assert_allclose(found[:100], offsets / np.linalg.norm(offsets, axis=1, keepdims=True), atol=1e-6)
    np.testing.assert_array_equal(found[100], 0.0)


CALL = "barycentric(p, a, b, c)"


def test_barycentric_coordinates_give_points_in_triangles_back(device: Device) -> None:
    random = np.random.default_rng(1)
    corners = random.normal(size=(200, 3, 3))
    weights = random.dirichlet(np.ones(3), 200)
    points = np.einsum("nk,nkj->nj", weights, corners)
    inputs = {"p": points, "a": corners[:, 0], "b": corners[:, 1], "c": corners[:, 2]}
    found = evaluate(device, FILE, CALL, inputs, 3)
    np.testing.assert_allclose(np.einsum("nk,nkj->nj", found, corners), points, atol=2e-4)


@pytest.mark.parametrize("triangle", ["point", "line", "outside"])
def test_barycentric_coordinates_are_shares_whatever_the_triangle(device: Device, triangle: str) -> None:
    a, b = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    c = {"point": a, "line": 2.0 * b, "outside": np.array([[0.0, 1.0, 0.0]])}[triangle]
    inputs = {"p": np.array([[5.0, -3.0, 2.0]]), "a": a, "b": a if triangle == "point" else b, "c": c}
    found = evaluate(device, FILE, CALL, inputs, 3)
    assert (found >= 0.0).all()
    assert found.sum() == pytest.approx(1.0)
