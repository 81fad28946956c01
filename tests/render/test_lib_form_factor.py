# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/form_factor.glsl` against the float64 oracle, on the same float32 numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.form_factor_classes import CLASSES
from tests.form_factor_cases import (
    FLOAT32_ABSOLUTE,
    HARD_CASES,
    SQUARE,
    TRIANGLE,
    float32_bound,
    room,
    single,
    summed,
    summed_bound,
    unit,
)
from tests.render.shader_functions import evaluate
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.render.device import Device

PATH = "lib/form_factor.glsl"
COUNT = 2000
CLASS_COUNT, CAMPAIGN_COUNT, CAMPAIGN_ROWS = 10_000, 1_000_000, 200_000
PI = np.pi

Array = np.ndarray


def shader(device: Device, points: Array, normals: Array, triangles: Array) -> Array:
    triangles = np.broadcast_to(triangles, (len(points), 3, 3))
    corners = single(triangles)
    area_vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inputs = {"p": points, "n": normals, "a": corners[:, 0], "b": corners[:, 1], "c": corners[:, 2], "v": area_vectors}
    return evaluate(device, PATH, "triangle_form_factor(p, n, a, b, c, v)", inputs)


def oracle(points: Array, normals: Array, triangles: Array) -> Array:
    return paired_form_factor(single(points), single(normals), np.broadcast_to(single(triangles), (len(points), 3, 3)))


def random_case(distance: float) -> tuple[Array, Array, Array]:
    random = np.random.default_rng(int(10 * distance))
    triangles = unit(random.normal(size=(COUNT, 3, 3)))
    points = distance * unit(random.normal(size=(COUNT, 3)))
    return points, unit(random.normal(size=(COUNT, 3))), triangles


# --- named cases ------------------------------------------------------------------------------------------------------


# Where the edge passes at a float32 unit of the corners' distance, rounding of the offsets decides.
AT_ROUNDING = {"2^-23 from the hypotenuse"}


@pytest.mark.parametrize("name", HARD_CASES)
def test_hard_case(device: Device, name: str) -> None:
    case = HARD_CASES[name]
    value = summed(case, lambda *pairs: shader(device, *pairs))
    if case.limit == 0.0:
        assert value == 0.0
    else:
        bound = summed_bound(case) if name in AT_ROUNDING else FLOAT32_ABSOLUTE
        assert value == pytest.approx(case.exact(), abs=bound)


# --- classes of adversarial samples -----------------------------------------------------------------------------------


def absolute(bound: float) -> Callable[..., Array]:
    return lambda points, normals, triangles, exact: np.full(len(points), bound)


def conditioned(points: Array, normals: Array, triangles: Array, exact: Array) -> Array:
    """What float32 can hold near edges."""
    return float32_bound(points, normals, triangles)


def far(points: Array, normals: Array, triangles: Array, exact: Array) -> Array:
    """1e-4 relative, and 2^-21 of the triangle squarely seen: heights over grazing horizons are rounded."""
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    squared = ((triangles.mean(axis=1) - points) ** 2).sum(axis=1)
    return 1e-4 * exact + 2.0**-21 * areas / (PI * squared)


def nothing(points: Array, normals: Array, triangles: Array, exact: Array) -> Array:
    assert not exact.any()
    return np.zeros(len(points))


BOUNDS: dict[str, Callable[..., Array]] = {
    "d/s 1 to 100": absolute(FLOAT32_ABSOLUTE),
    "d/s 2 to 4": absolute(FLOAT32_ABSOLUTE),
    "d/s 300": far,
    "d/s 100 to 1e6": far,
    "interior, h 1e-30 to 1": absolute(5e-6),
    "interior, h 1e-6 to 1e-3": absolute(5e-6),
    "1e-7 to 1e-3 from an edge": conditioned,
    "on a corner or an edge's line": nothing,
    "grazing the horizon": absolute(FLOAT32_ABSOLUTE),
    "in the plane": nothing,
    "behind": nothing,
    "under the horizon": nothing,
    "slivers 1e-7 to 1e-1": conditioned,
    "no area": nothing,
    "huge, 1e4 m": absolute(FLOAT32_ABSOLUTE),
    "tiny, 1e-4 m": far,
    "moved by 1e2 to 1e4 m": absolute(FLOAT32_ABSOLUTE),
}
# Where coordinates differ by 38 powers of ten, float32 loses all but the range of the result.
RANGE_ONLY = "0, 1, 1e-20, 1e18 anywhere"


def test_every_class_has_a_bound() -> None:
    assert set(CLASSES) == {*BOUNDS, RANGE_ONLY}


@pytest.mark.parametrize("name", CLASSES)
def test_class_of_samples(device: Device, name: str) -> None:
    samples = CLASSES[name](np.random.default_rng(11), CLASS_COUNT)
    values = shader(device, *samples)
    assert np.isfinite(values).all()
    assert ((values >= 0.0) & (values <= 1.0)).all()
    if name != RANGE_ONLY:
        exact = oracle(*samples)
        over = np.abs(values - exact) - BOUNDS[name](*samples, exact)
        worst = int(over.argmax())
        assert over[worst] <= 0.0, [array[worst] for array in (values, exact, *samples)]


@pytest.mark.full
@pytest.mark.parametrize("name", CLASSES)
def test_million_samples_of_a_class(device: Device, name: str) -> None:
    """Finite and within [0, 1] in every one, and exactly 0 where it is 0."""
    random = np.random.default_rng(12)
    for _ in range(CAMPAIGN_COUNT // CAMPAIGN_ROWS):
        values = shader(device, *CLASSES[name](random, CAMPAIGN_ROWS))
        assert np.isfinite(values).all()
        assert ((values >= 0.0) & (values <= 1.0)).all()
        if BOUNDS.get(name) is nothing:
            assert not values.any()


FARTHEST = float(np.float32(1e18))


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=arrays(
        np.float32, (64, 15), elements=st.floats(-FARTHEST, FARTHEST, width=32), fill=st.floats(-2.0, 2.0, width=32)
    )
)
def test_any_numbers_give_a_share(device: Device, rows: Array) -> None:
    points, directions, triangles = rows[:, :3], rows[:, 3:6].astype(np.float64), rows[:, 6:].reshape(-1, 3, 3)
    directions[~directions.any(axis=1)] = (0.0, 0.0, 1.0)
    values = shader(device, points, unit(directions), triangles)
    assert ((values >= 0.0) & (values <= 1.0)).all()


@pytest.mark.parametrize("distance", [0.1, 1.0, 4.0, 14.0, 18.0, 33.0, 100.0])
def test_random_triangles(device: Device, distance: float) -> None:
    case = random_case(distance)
    np.testing.assert_allclose(shader(device, *case), oracle(*case), rtol=0.0, atol=FLOAT32_ABSOLUTE)


# --- what holds for sums ----------------------------------------------------------------------------------------------


def split(triangles: Array) -> Array:
    """(4, n, 3, 3) the quarters of each triangle."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return np.array([np.stack(part, axis=1) for part in ([a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca])])


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
    parts = sum(shader(device, points, normals, part) for part in split(triangles))
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


# --- its parts --------------------------------------------------------------------------------------------------------


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
