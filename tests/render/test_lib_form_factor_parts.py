# SPDX-License-Identifier: GPL-3.0-or-later
"""The functions that `lib/form_factor.glsl` is made of, each against a form of its own."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import single, unit
from tests.render.form_factor_shader import COUNT, PATH, PI, Array
from tests.render.shader_functions import evaluate
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.render.device import Device


def test_double_arctangent_ratio(device: Device) -> None:
    u = single(np.linspace(1e-6, 1.0, COUNT))
    root = np.sqrt(u)
    values = evaluate(device, PATH, "double_arctangent_ratio(u)", {"u": u})
    np.testing.assert_allclose(values, 2.0 * np.arctan(root) / root, rtol=3e-7)


def random_edges() -> tuple[Array, Array, Array]:
    random = np.random.default_rng(3)
    a = single(10.0 ** random.uniform(-3, 2, (COUNT, 1)) * unit(random.normal(size=(COUNT, 3))))
    b = single(a + 10.0 ** random.uniform(-3, 1, (COUNT, 1)) * unit(random.normal(size=(COUNT, 3))))
    return a, b, single(unit(random.normal(size=(COUNT, 3))))


def angles_between(a: Array, b: Array) -> tuple[Array, Array]:
    """Angles and unit normals of the planes through a and b."""
    c = np.cross(a, b - a)
    length = np.linalg.norm(c, axis=-1)
    return np.arctan2(length, (a * b).sum(-1)), c / length[:, None]


def test_half_angle_normal(device: Device) -> None:
    a, b, _ = random_edges()
    call = "half_angle_normal(a, b, length(a), length(b), dot(a, b))"
    values = evaluate(device, PATH, call, {"a": a, "b": b}, 3)
    angle, direction = angles_between(a, b)
    half = np.tan(0.5 * np.minimum(angle, PI - angle))
    off = np.linalg.norm(values - half[:, None] * direction, axis=-1)
    # `b - a` is rounded by a unit of the longer one, which turns the plane by that over the point's distance from it.
    longer = np.maximum(np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))
    assert (off <= 1e-6 * longer / np.minimum(np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))).all()


def test_edge_irradiance(device: Device) -> None:
    a, b, n = random_edges()
    values = evaluate(device, PATH, "edge_irradiance(a, b, n)", {"a": a, "b": b, "n": n})
    angle, direction = angles_between(a, b)
    span = np.linalg.norm(b - a, axis=-1)
    distance = np.linalg.norm(np.cross(a, b), axis=-1) / span
    reach = np.maximum(np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))
    allowed = 1e-6 + 1e-6 * np.minimum(angle, 1.0) * reach / np.minimum(distance, reach)
    assert (np.abs(values - angle * (direction * n).sum(-1)) <= allowed).all()


def test_edges_cancel_exactly_with_their_neighbours(device: Device) -> None:
    a, b, n = random_edges()
    there = evaluate(device, PATH, "edge_irradiance(a, b, n)", {"a": a, "b": b, "n": n})
    back = evaluate(device, PATH, "edge_irradiance(b, a, n)", {"a": a, "b": b, "n": n})
    assert there.any()
    np.testing.assert_array_equal(there, -back)


def test_horizon_arc(device: Device) -> None:
    angles = np.concatenate([[0.0, PI], np.linspace(1e-6, PI - 1e-6, COUNT)])
    a = np.tile([2.0, 0.0, 0.0], (len(angles), 1))
    b = single(0.3 * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1))
    down = np.tile([0.0, 0.0, -1.0], (len(angles), 1))
    values = evaluate(device, PATH, "horizon_arc(a, b, n)", {"a": a, "b": b, "n": down})
    np.testing.assert_allclose(values, np.arctan2(b[:, 1], b[:, 0]), atol=1e-6)


def test_what_of_an_arc_leaves_the_horizon_does_not_count(device: Device) -> None:
    a, b = np.array([[2.0, 0.0, 1e-6]]), np.array([[2.0, 1e-7, -1e-6]])
    values = evaluate(device, PATH, "horizon_arc(a, b, n)", {"a": a, "b": b, "n": np.array([[0.0, 0.0, -1.0]])})
    np.testing.assert_allclose(values, [0.5e-7], rtol=1e-5)


def test_edge_at_horizon(device: Device) -> None:
    random = np.random.default_rng(8)
    a, b = (single(random.normal(size=(COUNT, 3))) for _ in range(2))
    a[:, 2], b[:, 2] = single(10.0 ** random.uniform(-6, 1, COUNT)), single(-(10.0 ** random.uniform(-6, 1, COUNT)))
    values = evaluate(device, PATH, "edge_at_horizon(a, b, a.z, b.z)", {"a": a, "b": b}, 3)
    share = a[:, 2] / (a[:, 2] - b[:, 2])
    np.testing.assert_allclose(values, a + (b - a) * share[:, None], atol=2e-6)
    swapped = evaluate(device, PATH, "edge_at_horizon(b, a, b.z, a.z)", {"a": a, "b": b}, 3)
    np.testing.assert_array_equal(values, swapped)
    level = evaluate(device, PATH, "edge_at_horizon(a, b, 0.0, 0.0)", {"a": a, "b": b}, 3)
    assert np.isfinite(level).all()


PREAMBLE = """
float outline_area(vec3 a, vec3 b, vec3 c, vec3 heights) {
    VisibleOutline o = visible_outline(a, b, c, heights);
    return length(cross(o.q1 - o.q0, o.q2 - o.q0)) + length(cross(o.q2 - o.q0, o.q3 - o.q0));
}
vec2 outline_shares(vec3 a, vec3 b, vec3 c, vec3 heights) {
    VisibleOutline o = visible_outline(a, b, c, heights);
    return vec2(o.area_012, o.area_023);
}
float outline_integrand(vec3 a, vec3 b, vec3 c, vec3 heights) {
    VisibleOutline o = visible_outline(a, b, c, heights);
    vec4 squared = vec4(dot(o.q0, o.q0), dot(o.q1, o.q1), dot(o.q2, o.q2), dot(o.q3, o.q3));
    return far_integrand(o, squared, vec4(dot(o.q0, o.q1), dot(o.q1, o.q2), dot(o.q0, o.q2), dot(o.q0, o.q3)));
}
"""


def heights_in_all_orders() -> Array:
    """Of three corners, at least one above the horizon."""
    levels = np.array([-1.5, -0.25, 0.0, 0.5, 2.0])
    heights = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(-1, 3)
    return heights[(heights > 0.0).any(axis=1)]


def outline_inputs(distance: float) -> dict[str, Array]:
    heights = heights_in_all_orders()
    corners = [np.tile(corner, (len(heights), 1)) for corner in np.array([[0, 0], [1, 0.25], [0.25, 1]])]
    points = {
        name: np.column_stack([xy + distance, heights[:, i]])
        for i, (name, xy) in enumerate(zip("abc", corners, strict=True))
    }
    return {**points, "h": heights}


def area_above(heights: Array) -> float:
    """Share of a triangle's area where the linear function with these values at its corners is positive."""
    nodes = (np.arange(400) + 0.5) / 400
    u, v = np.meshgrid(nodes, nodes)
    inside = u + v < 1.0
    level = heights[0] + u * (heights[1] - heights[0]) + v * (heights[2] - heights[0])
    return float((level[inside] > 0.0).mean())


def test_visible_outline(device: Device) -> None:
    inputs = outline_inputs(0.0)
    flat = {**inputs, **{name: inputs[name] * [1.0, 1.0, 0.0] for name in "abc"}}
    areas = evaluate(device, PATH, "outline_area(a, b, c, h)", flat, preamble=PREAMBLE)
    shares = evaluate(device, PATH, "outline_shares(a, b, c, h)", flat, 2, PREAMBLE)
    expected = np.array([area_above(heights) for heights in inputs["h"]])
    np.testing.assert_allclose(shares.sum(axis=1), expected, atol=5e-3)
    np.testing.assert_allclose(areas / (1.0 - 0.25**2), shares.sum(axis=1), atol=1e-6)


def test_far_integrand(device: Device) -> None:
    inputs = outline_inputs(100.0)
    values = evaluate(device, PATH, "outline_integrand(a, b, c, h)", inputs, preamble=PREAMBLE)
    nodes = (np.arange(300) + 0.5) / 300
    u, v = (grid[np.add.outer(nodes, nodes) < 1.0][:, None] for grid in np.meshgrid(nodes, nodes))
    for row, value in enumerate(values):
        a, b, c = (inputs[name][row] for name in "abc")
        position = a + u * (b - a) + v * (c - a)
        expected = (np.maximum(position[:, 2], 0.0) / (position**2).sum(-1) ** 2).mean()
        # The grid's own error, where the horizon leaves a small corner of it.
        assert value == pytest.approx(expected, rel=1e-2, abs=1e-2 * 0.5 / 100.0**4)


def test_midpoint_mean_is_exact_for_quadratic_functions(device: Device) -> None:
    """Heights that grow along an edge times inverse squares that do: x² over the triangle averages to 1/6."""
    heights, inverse = single([[1.0, 1.0, 0.0]]), np.sqrt(single([[1.0, 1.0, 0.0]]))
    (value,) = evaluate(device, PATH, "midpoint_mean(h, i)", {"h": heights, "i": inverse})
    assert value == pytest.approx(8.0 * 2.0 / 3.0)


def test_most_form_factor(device: Device) -> None:
    """A half space of light seen from its own boundary: (1 - cos of the angle between the normals) / 2."""
    angles = np.linspace(0.0, PI, 50)
    normals = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
    area = np.tile([0.0, 0.0, 3.0], (len(angles), 1))
    values = evaluate(device, PATH, "most_form_factor(n, v)", {"n": normals, "v": area})
    np.testing.assert_allclose(values, (1.0 - np.cos(angles)) / 2.0, atol=2e-7)
    huge = 1e6 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    points = np.tile([0.0, 0.0, 1e-3], (len(angles), 1))
    touching = paired_form_factor(points, normals, np.broadcast_to(huge, (len(angles), 4, 3)))
    np.testing.assert_allclose(values, touching, atol=1e-6)


def test_unit_scale(device: Device) -> None:
    x = single(np.concatenate([2.0 ** np.arange(-120.0, 121.0), np.random.default_rng(1).uniform(1e-3, 1e3, 100)]))
    values = evaluate(device, PATH, "unit_scale(x)", {"x": x})
    np.testing.assert_array_equal(values, 0.125 * 2.0 ** -np.floor(np.log2(x)))
