# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds for `lib/form_factor.glsl` whatever the numbers: sums, contact, reciprocity, scale, steps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import FLOAT32_ABSOLUTE, SQUARE, TRIANGLE, room, unit
from tests.render.form_factor_shader import PI, Array, oracle, random_case, shader
from tests.render.rooms import split
from vlm_addon.render.device import Device


def test_contact_straight_on_in_any_direction_is_no_more_than_one(device: Device) -> None:
    random = np.random.default_rng(22)
    count = 100_000
    normals = unit(random.normal(size=(count, 3)))
    right = unit(np.cross(normals, random.normal(size=(count, 3))))
    axes = np.stack([right, np.cross(normals, right)], axis=1)
    triangles = np.einsum("kd,ndc->nkc", np.array([[-1.0, -1.0], [2.0, -1.0], [-1.0, 2.0]]), axes)
    points = 10.0 ** random.uniform(-6.0, -1.0, (count, 1)) * normals
    values = shader(device, points, -normals, triangles)
    assert values.max() <= 1.0
    assert np.quantile(values, 0.9) > 0.99


@pytest.mark.parametrize("lean", [0.0, 1e-6, 1e-3])
def test_light_in_the_plane_of_the_surface_gives_nothing(device: Device, lean: float) -> None:
    """Lights drawn on the surface that they stand for, in any plane: only rounding lifts them over its horizon."""
    random = np.random.default_rng(21)
    count = 100_000
    normals = unit(random.normal(size=(count, 3)))
    right = unit(np.cross(normals, random.normal(size=(count, 3))))
    axes = np.stack([right, np.cross(normals, right)], axis=1)
    centres = random.uniform(-15.0, 15.0, (count, 1, 3))
    flat = random.uniform(-1.0, 1.0, (count, 3, 2))
    doubled = np.linalg.det(flat[:, 1:] - flat[:, :1])
    flat[doubled < 0.0] = flat[doubled < 0.0][:, ::-1]
    triangles = centres + np.einsum("nkd,ndc->nkc", flat, axes)
    points = (centres + np.einsum("nkd,ndc->nkc", random.uniform(-1.5, 1.5, (count, 1, 2)), axes))[:, 0]
    leaning = unit(normals + lean * random.normal(size=(count, 3)))
    # A lune between two planes that differ by so much is lean² / 4 of the hemisphere; 6 is far in the tail of `normal`.
    assert shader(device, points, leaning, triangles).max() < 1e-6 + (6.0 * lean) ** 2 / 4.0


@pytest.mark.parametrize("distance", [0.5, 1.5, 20.0])
def test_splitting_a_triangle_leaves_the_sum(device: Device, distance: float) -> None:
    points, normals, triangles = random_case(distance)
    quarters = split(triangles, 1).reshape(4, *triangles.shape)
    parts = sum(shader(device, points, normals, part) for part in quarters)
    np.testing.assert_allclose(parts, shader(device, points, normals, triangles), rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("height", [0.5, 0.1, 1e-3])
@pytest.mark.parametrize("cuts", [1, 7, 20])
def test_closed_mesh_fills_the_hemisphere(device: Device, cuts: int, height: float) -> None:
    """Plain float32 sums of up to 4,800 triangles, from points at most `height` from a wall."""
    triangles = room(cuts)
    random = np.random.default_rng(cuts)
    for _ in range(5):
        point = np.append(random.uniform(height, 1.0 - height, 2), height)[random.permutation(3)]
        normal = unit(random.normal(size=3))
        count = len(triangles)
        values = shader(device, np.tile(point, (count, 1)), np.tile(normal, (count, 1)), triangles)
        assert np.cumsum(values, dtype=np.float32)[-1] == pytest.approx(1.0, abs=1e-5)


def test_closed_mesh_fills_the_hemisphere_from_shared_edges(device: Device) -> None:
    """A point a hair from the diagonals and corners that triangles share sees no gap between them."""
    triangles = room(4)
    normal = unit(np.array([0.3, -0.2, 0.9]))
    for offset in (1e-3, 1e-5, 1e-6):
        for place in ([0.375, 0.375, offset], [0.5, 0.5, offset], [0.5, 0.3, offset], [0.25 + offset, offset, 0.5]):
            count = len(triangles)
            values = shader(device, np.tile(place, (count, 1)), np.tile(normal, (count, 1)), triangles)
            assert values.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-5)


def test_reciprocity_of_areas(device: Device) -> None:
    """A F(A to B) = B F(B to A) (seed 002, 2.3) for triangles, by quadrature over each."""
    first = TRIANGLE * 2.0
    second = TRIANGLE[::-1] @ np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]).T + [0.3, 0.2, 1.5]
    there, back = exchange(device, first, second), exchange(device, second, first)
    assert there == pytest.approx(back, rel=1e-5)


def exchange(device: Device, sender: Array, receiver: Array) -> float:
    """Area of `sender` times the mean form factor of `receiver` over it."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    u, v = np.repeat(nodes, 24), np.tile(nodes, 24)
    sides = sender[1] - sender[0], sender[2] - sender[1]
    points = sender[0] + u[:, None] * (sides[0] + v[:, None] * sides[1])
    doubled = np.cross(*sides)
    values = shader(device, points, np.tile(unit(doubled), (len(points), 1)), receiver)
    return float(np.linalg.norm(doubled) * (u * np.repeat(weights, 24) * np.tile(weights, 24)) @ values)


@pytest.mark.parametrize("scale", [1e-12, 1e-4, 1e4, 1e12])
def test_scale_changes_nothing(device: Device, scale: float) -> None:
    points, normals, triangles = random_case(2.0)
    scaled = shader(device, points * scale, normals, triangles * scale)
    np.testing.assert_allclose(scaled, shader(device, points, normals, triangles), rtol=0.0, atol=FLOAT32_ABSOLUTE)


def test_rotating_the_vertices_changes_nothing(device: Device) -> None:
    points, normals, triangles = random_case(1.5)
    expected = shader(device, points, normals, triangles)
    for turn in (1, 2):
        turned = shader(device, points, normals, np.roll(triangles, turn, axis=1))
        np.testing.assert_allclose(turned, expected, rtol=0.0, atol=FLOAT32_ABSOLUTE)


def test_sweeps_have_no_step(device: Device) -> None:
    """Over the horizon, and outwards across the far form's distance, neighbours differ by no more than the oracle's."""
    steps = 4001
    angles = np.linspace(0.0, PI, steps)
    over_horizon = (
        np.tile([0.2, 0.1, 0.05], (steps, 1)),
        np.stack([np.sin(angles), np.zeros(steps), -np.cos(angles)], axis=-1),
    )
    distances = np.linspace(8.0, 32.0, steps)
    outwards = distances[:, None] * unit([0.3, 0.2, 0.9]), np.tile(unit([-0.1, -0.3, -1.0]), (steps, 1))
    for points, normals in (over_horizon, outwards):
        values, exact = shader(device, points, normals, TRIANGLE), oracle(points, normals, TRIANGLE)
        assert np.abs(np.diff(values - exact)).max() < FLOAT32_ABSOLUTE


def test_square_from_its_centre(device: Device) -> None:
    """Two triangles whose shared diagonal passes under the point: Howell's catalogue, B-4."""
    parts = SQUARE[[[0, 1, 2], [0, 2, 3]]]
    for height in (0.01, 0.1, 1.0):
        points = np.tile([0.0, 0.0, height], (2, 1))
        x = 0.5 / height
        expected = 4.0 * x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / PI
        assert shader(device, points, np.tile([0.0, 0.0, -1.0], (2, 1)), parts).sum() == pytest.approx(
            expected, abs=2e-6
        )
