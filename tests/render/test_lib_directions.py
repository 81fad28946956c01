# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/directions.glsl`: unit vectors, as dense as they should be."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.halton import halton_points
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device

FILE = "lib/directions.glsl"
POINTS = halton_points(20_000)
NORMALS = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [-0.48, 0.64, 0.6]])


def cosines(directions: Float64, axis: Float64) -> Float64:
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-5)
    return directions.astype(float) @ axis


def test_sphere_points_are_even(device: Device) -> None:
    """Heights along any axis are uniform: moments 0, 1/3, 0, 1/5."""
    found = evaluate(device, FILE, "sphere_point(point)", {"point": POINTS}, 3)
    for axis in NORMALS:
        heights = cosines(found, axis)
        np.testing.assert_allclose([(heights**power).mean() for power in (1, 2, 3, 4)], [0, 1 / 3, 0, 1 / 5], atol=2e-3)


@pytest.mark.parametrize("normal", NORMALS.tolist())
def test_directions_are_as_dense_as_the_cosine(device: Device, normal: list[float]) -> None:
    """The square of the cosine is uniform over [0, 1], and no side is preferred."""
    inputs = {"point": POINTS, "normal": np.tile(normal, (len(POINTS), 1))}
    found = evaluate(device, FILE, "cosine_direction(normal, point)", inputs, 3)
    cosine = cosines(found, np.array(normal))
    assert cosine.min() >= 0.0
    filled, _ = np.histogram(cosine**2, bins=20, range=(0.0, 1.0))
    np.testing.assert_allclose(filled / len(POINTS), 1 / 20, atol=1e-3)
    np.testing.assert_allclose(found.mean(axis=0, dtype=float), 2.0 / 3.0 * np.array(normal), atol=2e-3)


def test_the_point_opposite_of_the_normal_is_finite(device: Device) -> None:
    inputs = {"point": np.array([[0.3, 0.0], [0.0, 1.0]]), "normal": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])}
    found = evaluate(device, FILE, "cosine_direction(normal, point)", inputs, 3)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-5)
