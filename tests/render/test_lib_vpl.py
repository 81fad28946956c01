# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/vpl.glsl` against core/vpl.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.scene import Float64
from vlm_addon.core.vpl import VirtualPointLights, vpl_irradiance
from vlm_addon.render.device import Device

FILE = "lib/vpl.glsl"
CALL = "bounded_geometry(p, n, q, m, area)"


def expected(inputs: dict[str, np.ndarray]) -> tuple[Float64, Float64]:
    bounded, removed = [], []
    for p, n, q, m, area in zip(*(inputs[name].astype(float) for name in ("p", "n", "q", "m", "area")), strict=True):
        light = VirtualPointLights(q[None], m[None], np.ones((1, 3)), np.array([area]))
        found = vpl_irradiance(p[None], n[None], light)
        bounded.append(found.irradiance[0, 0])
        removed.append(found.removed[0, 0])
    return np.array(bounded), np.array(removed)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_random_pairs_are_those_of_the_oracle(device: Device, scale: float) -> None:
    random = np.random.default_rng(3)
    count = 400
    unit = random.normal(size=(2, count, 3))
    unit /= np.linalg.norm(unit, axis=2, keepdims=True)
    inputs = {
        "p": scale * random.normal(size=(count, 3)),
        "n": unit[0],
        "q": scale * random.normal(size=(count, 3)),
        "m": unit[1],
        "area": scale**2 * random.random(count) ** 4,
    }
    inputs = {name: values.astype(np.float32) for name, values in inputs.items()}
    found = evaluate(device, FILE, CALL, inputs, 2).astype(float)
    bounded, removed = expected(inputs)
    unbounded = 0.1 / scale**2
    np.testing.assert_allclose(found[:, 0], bounded, rtol=1e-4, atol=1e-6 * unbounded)
    np.testing.assert_allclose(found[:, 1], removed, rtol=1e-4, atol=1e-6 * unbounded)


@pytest.mark.parametrize("distance", [0.0, 1e-30, 1e-18, 1e-10, 1e-3, 1.0])
@pytest.mark.parametrize("area", [0.0, 1e-20, 1.0, 1e20])
def test_contact_is_finite_and_no_brighter_than_the_light(device: Device, distance: float, area: float) -> None:
    up, down = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    inputs = {"p": np.zeros((1, 3)), "n": up, "q": distance * up, "m": down, "area": np.array([area])}
    found = evaluate(device, FILE, CALL, inputs, 2)
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    assert found[0, 0] * np.float32(area) <= 1.0
