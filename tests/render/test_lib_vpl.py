# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/vpl.glsl` against core/vpl.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.form_factor import polygon_form_factor
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


PIECE = "piece_geometry(p, n, q, m, area)"


def squares(q: Float64, m: Float64, area: Float64) -> Float64:
    """(n, 4, 3) corners of squares around q in the planes of m, turned as the shader does (Duff et al. 2017)."""
    turn = np.where(m[:, 2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (turn + m[:, 2])
    b = m[:, 0] * m[:, 1] * a
    u = np.stack([1.0 + turn * m[:, 0] ** 2 * a, turn * b, -turn * m[:, 0]], axis=1)
    v = np.stack([b, turn + m[:, 1] ** 2 * a, -m[:, 1]], axis=1)
    half = 0.5 * np.sqrt(area)[:, None]
    return np.stack([q + half * (s * u + t * v) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))], axis=1)


def random_pieces(nearest: float, farthest: float, scale: float = 1.0) -> dict[str, np.ndarray]:
    """Points at so many sides of the square from it, any directions and normals."""
    random = np.random.default_rng(11)
    count = 250
    unit = random.normal(size=(3, count, 3))
    unit /= np.linalg.norm(unit, axis=2, keepdims=True)
    area = scale**2 * 2.0 ** random.uniform(-6.0, 6.0, count)
    q = scale * random.normal(size=(count, 3))
    away = np.exp(random.uniform(np.log(nearest), np.log(farthest), count)) * np.sqrt(area)
    inputs = {"p": q + away[:, None] * unit[2], "n": unit[0], "q": q, "m": unit[1], "area": area}
    return {name: values.astype(np.float32) for name, values in inputs.items()}


def exact_pieces(inputs: dict[str, np.ndarray]) -> Float64:
    p, n, q, m, area = (inputs[name].astype(float) for name in ("p", "n", "q", "m", "area"))
    n, m = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (n, m))
    corners = squares(q, m, area)
    rows = zip(p, n, corners, strict=True)
    return np.array([polygon_form_factor(a[None], b[None], c[None])[0, 0] for a, b, c in rows]) / area


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_near_piece_is_the_square_around_its_middle(device: Device, scale: float) -> None:
    inputs = random_pieces(0.01, 3.9, scale)
    found = evaluate(device, FILE, PIECE, inputs).astype(float)
    area = inputs["area"].astype(float)
    np.testing.assert_allclose(found * area, exact_pieces(inputs) * area, atol=2e-5)


def test_a_far_piece_is_a_point(device: Device) -> None:
    inputs = random_pieces(4.1, 1e4)
    found = evaluate(device, FILE, PIECE, inputs).astype(float)
    p, n, q, m = (inputs[name].astype(float) for name in ("p", "n", "q", "m"))
    way = q - p
    squared = (way**2).sum(axis=1)
    facing = np.maximum((way * n).sum(axis=1), 0.0) * np.maximum(-(way * m).sum(axis=1), 0.0)
    point = facing / (np.pi * squared**2)
    np.testing.assert_allclose(found, point, rtol=1e-4, atol=1e-5 * point.max())
    # What is given up where a square becomes a point: shares of what it would bring if both sides faced.
    lost = np.abs(exact_pieces(inputs) - point) * np.pi * squared
    assert lost.max() < 0.03


@pytest.mark.parametrize("distance", [0.0, 1e-30, 1e-18, 1e-10, 1e-3, 1.0])
@pytest.mark.parametrize("area", [0.0, 1e-20, 1.0, 1e20])
def test_contact_with_a_piece_is_finite_and_no_brighter_than_it(device: Device, distance: float, area: float) -> None:
    up, down = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    inputs = {"p": np.zeros((1, 3)), "n": up, "q": distance * up, "m": down, "area": np.array([area])}
    found = evaluate(device, FILE, PIECE, inputs)
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    assert found[0] * np.float32(area) <= 1.0 + 1e-6
