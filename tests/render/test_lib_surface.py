# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/surface.glsl` against tangent-space normal mapping written out in float64."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.render.device import Device

FILE = "lib/surface.glsl"
MAPPED = "mapped_normal(n, t, texel, strength, otherwise)"
COUNT = 500


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def case(**fixed: object) -> dict[str, np.ndarray]:
    """Interpolated normals and tangents (shorter than 1, not at right angles), and maps that face outwards."""
    random = np.random.default_rng(8)
    normal = unit(random.normal(size=(COUNT, 3))) * random.uniform(0.6, 1.0, (COUNT, 1))
    tangent = unit(np.cross(normal, random.normal(size=(COUNT, 3)))) + 0.1 * random.normal(size=(COUNT, 3))
    values = {
        "n": normal,
        "t": np.c_[tangent, random.choice([-1.0, 1.0], COUNT)],
        "texel": np.c_[random.uniform(0, 1, (COUNT, 2)), random.uniform(0.55, 1, COUNT)],
        "strength": random.uniform(0, 2, COUNT),
        "otherwise": unit(random.normal(size=(COUNT, 3))),
    }
    shapes = {name: array.shape for name, array in values.items()}
    values |= {name: np.broadcast_to(np.asarray(value, float), shapes[name]) for name, value in fixed.items()}
    return {name: np.ascontiguousarray(array, np.float32) for name, array in values.items()}


def oracle(inputs: dict[str, np.ndarray]) -> np.ndarray:
    """Mikkelsen's frame: bitangent = sign (n x t), none of the three made unit; then a mix with the plain normal."""
    n, t, texel = (inputs[name].astype(float) for name in ("n", "t", "texel"))
    x, y, z = (2 * texel - 1).T[:, :, None]
    mapped = unit(x * t[:, :3] + y * np.sign(t[:, 3:]) * np.cross(n, t[:, :3]) + z * n)
    plain = unit(n)
    return unit(plain + (mapped - plain) * inputs["strength"].astype(float)[:, None])


def test_mapped_normal_against_the_oracle(device: Device) -> None:
    inputs = case()
    np.testing.assert_allclose(evaluate(device, FILE, MAPPED, inputs, 3), oracle(inputs), atol=2e-6)


@pytest.mark.parametrize(
    "fixed",
    [{"strength": 0.0}, {"strength": -1.0}, {"t": (0, 0, 0, 1)}, {"texel": (0.5, 0.5, 0.5)}],
    ids=["strength 0", "negative strength", "no tangent", "empty texel"],
)
def test_without_a_map_the_normal_stays(device: Device, fixed: dict[str, object]) -> None:
    inputs = case(**fixed)
    np.testing.assert_allclose(evaluate(device, FILE, MAPPED, inputs, 3), unit(inputs["n"].astype(float)), atol=1e-6)


def test_without_a_normal_the_other_one_is_taken(device: Device) -> None:
    inputs = case(n=(0, 0, 0), t=(0, 0, 0, 1))
    assert (evaluate(device, FILE, MAPPED, inputs, 3) == inputs["otherwise"]).all()


def test_whatever_comes_in_a_unit_vector_comes_out(device: Device) -> None:
    """Zero, tiny, parallel and opposite vectors, texels and strengths beyond their range, in all combinations."""
    vectors = [(0, 0, 0), (1e-18, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0.6, 0, 0.8)]
    texels = [(0, 0, 0), (1, 1, 1), (0.5, 0.5, 1), (0.5, 0.5, 0), (1e6, 0, 0), (0.5, 0.5, 0.5)]
    rows = list(itertools.product(vectors, vectors, (-1, 0, 1), texels, (-1, 0, 1, 2, 1e6)))
    inputs = {
        "n": np.array([row[0] for row in rows]),
        "t": np.array([(*row[1], row[2]) for row in rows]),
        "texel": np.array([row[3] for row in rows]),
        "strength": np.array([row[4] for row in rows]),
        "otherwise": np.tile([0.0, 0.0, 1.0], (len(rows), 1)),
    }
    found = evaluate(device, FILE, MAPPED, inputs, 3)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1.0, 1e3, 1e12])
def test_unit_or_keeps_the_direction(device: Device, size: float) -> None:
    vectors = np.random.default_rng(2).normal(size=(100, 3))
    found = evaluate(device, FILE, "unit_or(v, vec3(0.0, 0.0, 1.0))", {"v": size * vectors}, 3)
    np.testing.assert_allclose(found, unit(vectors), atol=1e-6)


def test_unit_or_falls_back_where_there_is_no_direction(device: Device) -> None:
    vectors = np.array([[0, 0, 0], [-0.0, 0, 0], [1e-30, 0, 0], [1e-20, -1e-20, 0]])
    found = evaluate(device, FILE, "unit_or(v, vec3(0.6, 0.0, 0.8))", {"v": vectors}, 3)
    assert (found == np.float32([0.6, 0.0, 0.8])).all()


def test_has_bit(device: Device) -> None:
    flags = np.array([0, 1, 2, 3, 1 << 9, (1 << 9) - 1, -1], np.int32)
    for bit in (0, 1, 9, 31):
        found = evaluate(device, FILE, f"has_bit(uint(flags), 1u << {bit}u) ? 1.0 : 0.0", {"flags": flags})
        assert found.tolist() == [float(int(flag) >> bit & 1) for flag in flags]


SEEN = "seen_point(p, from, towards, n, offset, reach)"


def ray_cases(reach: float) -> dict[str, np.ndarray]:
    """Rays onto planes near the origin, from points around it; p: a millimetre off what they meet."""
    random = np.random.default_rng(9)
    normal = unit(random.normal(size=(COUNT, 3)))
    start = random.normal(size=(COUNT, 3))
    target = random.normal(size=(COUNT, 3))
    return {
        "p": target + 1e-3,
        "from": start,
        "towards": target - start,
        "n": normal,
        "offset": (normal * target).sum(axis=1),
        "reach": np.full(COUNT, reach),
        "target": target,
    }


def test_seen_point_of_a_large_triangle_lies_on_its_plane_and_the_ray(device: Device) -> None:
    inputs = ray_cases(1e3)
    found = evaluate(device, FILE, SEEN, inputs, 3)
    slope = np.abs((inputs["n"] * inputs["towards"]).sum(axis=1))
    clear = slope > 0.05
    np.testing.assert_allclose(found[clear], inputs["target"][clear], atol=2e-5)


@pytest.mark.parametrize("problem", ["a small triangle", "no ray", "along the plane"])
def test_seen_point_is_the_interpolated_one_where_the_plane_does_not_help(device: Device, problem: str) -> None:
    inputs = ray_cases(1e-3 if problem == "a small triangle" else 1e3)
    if problem == "no ray":
        inputs["towards"] = np.zeros((COUNT, 3))
    elif problem == "along the plane":
        inputs["towards"] = np.tile([1.0, 0.0, 0.0], (COUNT, 1))
        inputs["n"] = np.tile([0.0, 0.0, 1.0], (COUNT, 1))
    found = evaluate(device, FILE, SEEN, inputs, 3)
    assert (found == inputs["p"].astype(np.float32)).all()
