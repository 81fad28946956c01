# SPDX-License-Identifier: GPL-3.0-or-later
"""The float64 form factor against 50 digits, against closed forms and against what must hold for any polygon."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.form_factor import polygon_form_factor

UNIT_SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
DOWN = np.array([0.0, 0.0, -1.0])
RELATIVE, ABSOLUTE = 1e-12, 1e-14


def one(point: object, normal: object, polygon: object) -> float:
    return float(polygon_form_factor(np.array([point]), np.array([normal]), np.array([polygon]))[0, 0])


def exact(point: np.ndarray, normal: np.ndarray, polygon: np.ndarray) -> float:
    """Eq. 3.1 of seed 002 after clipping, at 50 digits, from the very float64 numbers."""
    with mpmath.workdps(50):
        p, n = mpmath.matrix(point.tolist()), mpmath.matrix(normal.tolist())
        corners = [mpmath.matrix(v.tolist()) - p for v in polygon]
        area = mpmath.matrix([0, 0, 0])
        for a, b in itertools.pairwise(corners[1:]):
            area += cross(a - corners[0], b - corners[0])
        if dot(area, corners[0]) >= 0:
            return 0.0
        clipped = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            ha, hb = dot(n, a), dot(n, b)
            if ha >= 0:
                clipped.append(a)
            if (ha > 0 > hb) or (ha < 0 < hb):
                clipped.append(a + (b - a) * (ha / (ha - hb)))
        total = mpmath.mpf(0)
        for a, b in zip(clipped, clipped[1:] + clipped[:1], strict=True):
            c = cross(a, b)
            length = mpmath.sqrt(dot(c, c))
            if length > 0:
                total -= mpmath.atan2(length, dot(a, b)) * dot(n, c) / length
        return float(total / (2 * mpmath.pi))


def dot(a: mpmath.matrix, b: mpmath.matrix) -> mpmath.mpf:
    return sum((x * y for x, y in zip(a, b, strict=True)), mpmath.mpf(0))


def cross(a: mpmath.matrix, b: mpmath.matrix) -> mpmath.matrix:
    return mpmath.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.parametrize("distance", [0.3, 1.0, 4.0, 15.0, 40.0, 1e3, 1e6])
def test_random_triangles_against_fifty_digits(distance: float) -> None:
    random = np.random.default_rng(int(distance * 10))
    count = 150
    triangles = unit(random.normal(size=(count, 3, 3)))
    points = distance * unit(random.normal(size=(count, 3)))
    normals = unit(random.normal(size=(count, 3)))
    # Far form factors lie below 1e-14; there the bound is what rounding `vertex - point` moves grazing cosines by.
    absolute = ABSOLUTE if distance < 20.0 else np.finfo(float).eps * distance / (np.pi * distance**2)
    for point, normal, triangle in zip(points, normals, triangles, strict=True):
        assert one(point, normal, triangle) == pytest.approx(exact(point, normal, triangle), rel=RELATIVE, abs=absolute)


@pytest.mark.parametrize("distance", [2.0, 12.0, 60.0, 1e3])
@pytest.mark.parametrize("above", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1)])
def test_triangle_cut_by_the_horizon_against_fifty_digits(distance: float, above: tuple[int, ...]) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.25, 0.125], [0.25, 0.5, -0.75]])
    area_vector = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    centroid = triangle.mean(axis=0)
    # A normal with given heights of the three corners over the point: solve for it, the point placed to fit.
    heights = np.where(np.array(above, bool), 0.3, -0.2) + np.array([0.0, 0.02, -0.03])
    gradient = np.linalg.lstsq(triangle[1:] - triangle[0], heights[1:] - heights[0], rcond=None)[0]
    normal = gradient + unit(area_vector) * np.sqrt(max(0.0, 1.0 - gradient @ gradient))
    normal = unit(normal)
    rise = (triangle - centroid) @ normal
    level = -0.5 * (rise[np.array(above, bool)].min() + rise[~np.array(above, bool)].max())
    along = unit(np.cross(normal, np.cross(area_vector, normal)))
    point = centroid + distance * along - level * normal
    expected = exact(point, normal, triangle)
    assert expected > 0.0
    assert one(point, normal, triangle) == pytest.approx(expected, rel=1e-11)


def octagon(flatten: float) -> np.ndarray:
    """A convex octagon in the plane z = 0 whose coordinates are exact."""
    x = np.array([2, 1, -1, -2, -2, -1, 1, 2]) / 2.0
    y = np.array([1, 2, 2, 1, -1, -2, -2, -1]) / 2.0
    return np.stack([x, y * flatten, np.zeros(8)], axis=-1)


@pytest.mark.parametrize("flatten", [1.0, 2.0**-10])
def test_octagons_against_fifty_digits(flatten: float) -> None:
    random = np.random.default_rng(7)
    for distance in (0.5, 3.0, 50.0):
        for _ in range(20):
            point = distance * unit(random.normal(size=3))
            normal = unit(random.normal(size=3))
            outline = octagon(flatten)
            assert one(point, normal, outline) == pytest.approx(exact(point, normal, outline), rel=1e-12, abs=1e-14)


def test_definition_as_an_area_integral() -> None:
    """The edge sum equals the integral of cos cos' / (pi d^2), also where the horizon cuts the polygon."""
    point, normal = np.array([0.2, 0.1, 0.8]), unit(np.array([0.9, 0.0, -0.3]))
    x = (np.arange(1500) + 0.5) / 1500 - 0.5
    grid = np.stack([*np.meshgrid(x, x), np.zeros((1500, 1500))], axis=-1) - point
    squared = (grid**2).sum(-1)
    integrand = np.maximum(grid @ normal, 0.0) * point[2] / (np.pi * squared**2)
    assert one(point, normal, UNIT_SQUARE) == pytest.approx(integrand.mean(), abs=1e-6)


@pytest.mark.parametrize("height", [1e-3, 1e-6, 1e-12, 1e-30])
def test_contact_from_above_is_one(height: float) -> None:
    assert one([0.1, 0.2, height], DOWN, UNIT_SQUARE) == pytest.approx(1.0, abs=10 * height**2 + 1e-14)


def test_wall_meeting_floor_is_half() -> None:
    wall = np.array([[-1e6, 0, 0], [1e6, 0, 0], [1e6, 0, 1e6], [-1e6, 0, 1e6]], float)
    assert one([0.0, -1e-6, 0.0], [0.0, 0.0, 1.0], wall) == pytest.approx(0.5, abs=1e-11)


def test_huge_parallel_plane_is_one() -> None:
    assert one([0.0, 0.0, 1.0], DOWN, UNIT_SQUARE * 1e8) == pytest.approx(1.0, abs=1e-15)


def test_huge_perpendicular_plane_is_half() -> None:
    assert one([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], UNIT_SQUARE * 1e9) == pytest.approx(0.5, abs=1e-8)


@pytest.mark.parametrize(
    ("point", "normal"),
    [
        pytest.param([0.0, 0.0, -1.0], [0.0, 0.0, 1.0], id="behind"),
        pytest.param([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0], id="in the plane"),
        pytest.param([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], id="inside the polygon"),
        pytest.param([0.5, 0.5, 0.0], [0.0, 0.0, -1.0], id="on a vertex"),
        pytest.param([0.5, 0.1, 0.0], [0.0, 0.0, -1.0], id="on an edge"),
        pytest.param([0.5, 3.0, 0.0], [0.0, -1.0, 0.0], id="collinear with an edge"),
        pytest.param([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], id="under the horizon"),
        pytest.param([-0.5, 0.0, 1.0], [-1.0, 0.0, 0.0], id="under the horizon with an edge on it"),
    ],
)
def test_exactly_zero(point: list[float], normal: list[float]) -> None:
    assert one(point, normal, UNIT_SQUARE) == 0.0


def test_edge_on_the_horizon_counts_in_full() -> None:
    point, normal = np.array([-0.5, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    assert one(point, normal, UNIT_SQUARE) == pytest.approx(exact(point, normal, UNIT_SQUARE), rel=RELATIVE)


@pytest.mark.parametrize("sliver", [1e-3, 1e-7, 0.0])
def test_slivers_give_no_more_than_their_area(sliver: float) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, sliver, 0.0]])
    assert 0.0 <= one([0.2, 0.1, 1.0], DOWN, triangle) <= 0.5 * sliver / np.pi


def test_repeated_vertices_change_nothing() -> None:
    point, normal = [0.3, -0.2, 0.7], unit(np.array([0.5, 0.2, -0.4]))
    repeated = UNIT_SQUARE[[0, 0, 1, 2, 2, 3]]
    assert one(point, normal, repeated) == pytest.approx(one(point, normal, UNIT_SQUARE), rel=1e-13)


@pytest.mark.parametrize("distance", [1e2, 1e3, 1e4, 1e6])
def test_far_polygons_follow_the_inverse_square(distance: float) -> None:
    direction = unit(np.array([0.3, 0.4, 0.8]))
    normal = unit(np.array([0.1, -0.3, -1.0]))
    point = distance * direction
    expected = -(normal @ direction) * direction[2] / (np.pi * distance**2)
    assert one(point, normal, UNIT_SQUARE) / expected == pytest.approx(1.0, abs=3 / distance**2 + 1e-10 + 1 / distance)


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_rotating_the_vertices_changes_nothing(corner: int) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 0.9, -0.2]])
    point, normal = [0.5, 0.5, 1.0], unit(np.array([0.3, 0.1, -0.6]))
    assert one(point, normal, np.roll(triangle, corner, axis=0)) == pytest.approx(
        one(point, normal, triangle), rel=1e-13
    )


def test_flipping_the_winding_gives_nothing() -> None:
    assert one([0.1, 0.2, 1.0], DOWN, UNIT_SQUARE[::-1]) == 0.0


def test_splitting_a_triangle_leaves_the_sum() -> None:
    a, b, c = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 0.9, -0.2]])
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
    point, normal = np.array([[0.5, 0.5, 0.4]]), unit(np.array([[0.9, 0.1, -0.2]]))
    split = polygon_form_factor(point, normal, parts).sum()
    assert split == pytest.approx(one(point[0], normal[0], [a, b, c]), rel=1e-12)


CUBE = np.array(
    [
        [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]],
        [[1, 0, 0], [1, 0, 1], [1, 1, 1], [1, 1, 0]],
        [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]],
        [[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]],
    ],
    float,
)
"""Faces of a cube seen from inside: x = 0, x = 1, y = 0, y = 1, z = 0, z = 1."""


@given(
    st.tuples(*[st.floats(1e-3, 1.0 - 1e-3)] * 3),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: np.linalg.norm(n) > 1e-2),
)
@settings(max_examples=200, deadline=None)
def test_closed_box_fills_the_hemisphere(point: tuple[float, ...], normal: tuple[float, ...]) -> None:
    total = polygon_form_factor(np.array([point]), unit(np.array([normal])), CUBE).sum()
    assert total == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize(("face", "expected"), [(5, 0.1998), (0, 0.2000), (3, 0.2000)])
def test_unit_cube_face_to_face(face: int, expected: float) -> None:
    """Known exchange factors of the cube: 0.1998 opposite, 0.2000 adjacent."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    x, y = np.meshgrid(0.5 * (nodes + 1), 0.5 * (nodes + 1))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    share = 0.25 * np.outer(weights, weights).ravel() @ polygon_form_factor(points, normals, CUBE[face : face + 1])
    assert share[0] == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_scale_changes_nothing(scale: float) -> None:
    point, normal = np.array([0.3, -0.2, 0.7]), unit(np.array([0.5, 0.2, -0.4]))
    assert one(point * scale, normal, UNIT_SQUARE * scale) == pytest.approx(one(point, normal, UNIT_SQUARE), rel=1e-13)


def test_sweep_over_the_horizon_has_no_step() -> None:
    angles = np.linspace(0.0, np.pi, 2001)
    normals = np.stack([np.sin(angles), np.zeros_like(angles), -np.cos(angles)], axis=-1)
    values = polygon_form_factor(np.tile([0.0, 0.0, 0.05], (len(angles), 1)), normals, UNIT_SQUARE[None])[:, 0]
    assert np.abs(np.diff(values)).max() < 1.1 * (angles[1] - angles[0])


@pytest.mark.parametrize(
    ("points", "normals", "polygons"),
    [
        ([[np.nan, 0, 0]], [[0, 0, 1.0]], UNIT_SQUARE[None]),
        ([[0, 0, 0.0]], [[0, 0, np.inf]], UNIT_SQUARE[None]),
        ([[0, 0, 0.0]], [[0, 0, 1.0]], UNIT_SQUARE[None, :2]),
        ([[0, 0, 0.0]], [[0, 0, 1.0]], np.zeros((1, 9, 3))),
        ([[0, 0, 0.0], [1, 0, 0]], [[0, 0, 1.0]], UNIT_SQUARE[None]),
    ],
    ids=["nan", "infinity", "two vertices", "nine vertices", "lengths differ"],
)
def test_bad_input_is_refused(points: object, normals: object, polygons: object) -> None:
    with pytest.raises(InvalidInput):
        polygon_form_factor(points, normals, polygons)
