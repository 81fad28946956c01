# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/form_factor.glsl` against the float64 oracle, on the same float32 numbers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.render.device import Device

COUNT = 2000
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
DOWN = np.array([0.0, 0.0, -1.0])


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def single(array: np.ndarray) -> np.ndarray:
    """What the shader sees, as float64."""
    return np.asarray(array, np.float32).astype(np.float64)


def shader(device: Device, points: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    triangles = np.broadcast_to(triangles, (len(points), 3, 3))
    corners = single(triangles)
    area_vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inputs = {"p": points, "n": normals, "a": corners[:, 0], "b": corners[:, 1], "c": corners[:, 2], "v": area_vectors}
    call = "triangle_form_factor(p, n, a, b, c, v)"
    return evaluate(device, "lib/form_factor.glsl", call, inputs)


def oracle(points: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    return paired_form_factor(single(points), single(normals), np.broadcast_to(single(triangles), (len(points), 3, 3)))


def random_case(distance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(int(10 * distance))
    triangles = unit(random.normal(size=(COUNT, 3, 3)))
    points = distance * unit(random.normal(size=(COUNT, 3)))
    return points, unit(random.normal(size=(COUNT, 3))), triangles


@pytest.mark.parametrize("distance", [0.1, 1.0, 4.0, 14.0, 18.0, 33.0, 100.0])
def test_random_triangles_absolute(device: Device, distance: float) -> None:
    case = random_case(distance)
    np.testing.assert_allclose(shader(device, *case), oracle(*case), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("distance", [100.0, 1e4, 1e6])
def test_far_triangles_relative(device: Device, distance: float) -> None:
    """Away from grazing angles, where float32 heights are noise."""
    points, normals, triangles = random_case(distance)
    expected = oracle(points, normals, triangles)
    clear = expected > 1e-3 / (np.pi * distance**2)
    assert clear.sum() > COUNT // 10
    np.testing.assert_allclose(shader(device, points, normals, triangles)[clear], expected[clear], rtol=1e-4)


@pytest.mark.parametrize("height", [1e-1, 1e-3, 1e-6, 1e-12, 1e-20])
def test_over_the_interior(device: Device, height: float) -> None:
    weights = 0.9 * np.random.default_rng(3).dirichlet([1, 1, 1], COUNT) + 0.1 / 3
    points = weights @ TRIANGLE + np.array([0.0, 0.0, height])
    case = points, np.tile(DOWN, (COUNT, 1)), TRIANGLE
    np.testing.assert_allclose(shader(device, *case), oracle(*case), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("distance", [0.3, 3.0, 50.0])
def test_horizon_through_the_triangle(device: Device, distance: float) -> None:
    random = np.random.default_rng(9)
    triangles = unit(random.normal(size=(COUNT, 3, 3)))
    points = distance * unit(random.normal(size=(COUNT, 3)))
    # Normals at right angles to the direction of a random point of the triangle.
    towards = np.einsum("nk,nkc->nc", random.dirichlet([1, 1, 1], COUNT), triangles) - points
    normals = unit(np.cross(towards, random.normal(size=(COUNT, 3))))
    expected = oracle(points, normals, triangles)
    assert (expected > 0).sum() > COUNT // 4
    np.testing.assert_allclose(
        shader(device, points, normals, triangles), expected, rtol=0.0, atol=2e-7 + 3e-6 / (np.pi * distance**2)
    )


@pytest.mark.parametrize(
    ("point", "normal"),
    [
        pytest.param([0.2, 0.2, -1.0], [0.0, 0.0, 1.0], id="behind"),
        pytest.param([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0], id="in the plane"),
        pytest.param([0.2, 0.2, 0.0], [0.0, 0.0, -1.0], id="inside the triangle"),
        pytest.param([1.0, 0.0, 0.0], [0.0, 0.0, -1.0], id="on a vertex"),
        pytest.param([0.5, 0.0, 0.0], [0.0, 0.0, -1.0], id="on an edge"),
        pytest.param([3.0, 0.0, 0.0], [-1.0, 0.0, 0.0], id="collinear with an edge"),
        pytest.param([0.2, 0.2, 1.0], [0.0, 0.0, 1.0], id="under the horizon"),
        pytest.param([0.0, 0.2, 1.0], [-1.0, 0.0, 0.0], id="under the horizon with an edge on it"),
    ],
)
def test_exactly_zero(device: Device, point: list[float], normal: list[float]) -> None:
    assert shader(device, np.array([point]), np.array([normal]), TRIANGLE)[0] == 0.0


def degenerate_triangles() -> dict[str, np.ndarray]:
    sliver = TRIANGLE.copy()
    sliver[2] = [0.5, 1e-7, 0.0]
    collinear = TRIANGLE.copy()
    collinear[2] = [2.0, 0.0, 0.0]
    return {
        "point": np.zeros((3, 3)),
        "two corners alike": TRIANGLE[[0, 1, 1]],
        "collinear": collinear,
        "sliver": sliver,
        "tiny": 1e-6 * TRIANGLE,
        "huge": 1e6 * TRIANGLE,
    }


@pytest.mark.parametrize("name", list(degenerate_triangles()))
def test_degenerate_triangles_give_no_nan_and_no_more_than_one(device: Device, name: str) -> None:
    triangle = degenerate_triangles()[name]
    random = np.random.default_rng(11)
    grid = np.stack(np.meshgrid(*[[-1.0, 0.0, 1e-7, 0.25, 0.5, 1.0]] * 3), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, triangle, 0.5 * (triangle + np.roll(triangle, 1, axis=0))])
    normals = unit(random.normal(size=points.shape))
    values = shader(device, points, normals, triangle)
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()
    assert (values <= 1.0).all()
    if name in ("point", "two corners alike", "collinear"):
        assert not values.any()


def test_splitting_a_triangle_leaves_the_sum(device: Device) -> None:
    random = np.random.default_rng(5)
    triangles = unit(random.normal(size=(COUNT, 3, 3)))
    points, normals = 1.5 * unit(random.normal(size=(COUNT, 3))), unit(random.normal(size=(COUNT, 3)))
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [np.stack(part, axis=1) for part in ([a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca])]
    split = sum(shader(device, points, normals, part) for part in parts)
    np.testing.assert_allclose(split, shader(device, points, normals, triangles), rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_scale_changes_nothing(device: Device, scale: float) -> None:
    points, normals, triangles = random_case(2.0)
    scaled = shader(device, points * scale, normals, triangles * scale)
    np.testing.assert_allclose(scaled, shader(device, points, normals, triangles), rtol=0.0, atol=1e-6)


def test_closed_sphere_seen_from_inside_is_one(device: Device) -> None:
    """Sum over a subdivided octahedron turned inwards, 2,048 triangles."""
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [(0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0), (0, 1, 5), (1, 2, 5), (2, 3, 5), (3, 0, 5)]
    triangles = corners[np.array(faces)]
    for _ in range(4):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
        parts = ([a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca])
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    for point, normal in (([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), ([0.4, -0.5, 0.3], [0.6, 0.8, 0.0])):
        rows = len(triangles)
        values = shader(device, np.tile(point, (rows, 1)), np.tile(normal, (rows, 1)), triangles)
        assert values.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-5)
