# SPDX-License-Identifier: GPL-3.0-or-later
"""The form factor in float64 and float32 against 50 digits, closed forms and what must hold for any polygon."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.form_factor_cases import (
    CUBE,
    DOWN,
    FLOAT32_ABSOLUTE,
    FLOAT32_UNIT,
    HARD_CASES,
    ORACLE_ABSOLUTE,
    ORACLE_RELATIVE,
    SQUARE,
    exact_form_factor,
    float32_bound,
    single,
    summed,
    unit,
)
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.form_factor import (
    paired_form_factor,
    paired_vector_form_factor,
    polygon_form_factor,
)

RANDOM_COUNT = 10_000
PERTURBATIONS = 12


def one(point: object, normal: object, polygon: object) -> float:
    return float(polygon_form_factor([point], [normal], [polygon])[0, 0])


def octagon(flatten: float) -> np.ndarray:
    """A convex octagon in the plane z = 0 whose coordinates are exact."""
    x = np.array([2, 1, -1, -2, -2, -1, 1, 2]) / 2.0
    y = np.array([1, 2, 2, 1, -1, -2, -2, -1]) / 2.0
    return np.stack([x, y * flatten, np.zeros(8)], axis=-1)


def assert_exact(points: np.ndarray, normals: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Holds the oracle to 1e-12 relative or 1e-14 absolute, of which far polygons get no more than they fill."""
    values = paired_form_factor(points, normals, polygons)
    exact = np.array([exact_form_factor(*pair) for pair in zip(points, normals, polygons, strict=True)])
    centroids = polygons.mean(axis=1)
    radii = np.linalg.norm(polygons - centroids[:, None], axis=-1).max(-1)
    filled = np.minimum(1.0, (radii / np.linalg.norm(centroids - points, axis=-1)) ** 2)
    excess = np.abs(values - exact) / np.maximum(ORACLE_RELATIVE * exact, ORACLE_ABSOLUTE * filled)
    assert excess.max() <= 1.0, (int(excess.argmax()), values[excess.argmax()], exact[excess.argmax()])
    return exact


def test_random_triangles_against_fifty_digits() -> None:
    """Distances from a hundredth to a million of the triangle's size, log-uniform."""
    random = np.random.default_rng(1)
    triangles = unit(random.normal(size=(RANDOM_COUNT, 3, 3)))
    distances = 10.0 ** random.uniform(-2.0, 6.0, (RANDOM_COUNT, 1))
    points = distances * unit(random.normal(size=(RANDOM_COUNT, 3)))
    exact = assert_exact(points, unit(random.normal(size=(RANDOM_COUNT, 3))), triangles)
    assert (exact > 0.0).mean() > 0.2


@pytest.mark.parametrize("gap", [0.0, 1e-30, 1e-17, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("part", ["vertex", "edge", "edge's line", "interior"])
def test_contact_against_fifty_digits(part: str, gap: float) -> None:
    """Points that touch a tilted triangle or miss it by less than rounding."""
    random = np.random.default_rng(2)
    count = 100
    triangles = unit(random.normal(size=(count, 3, 3)))
    a, b = triangles[:, 0], triangles[:, 1]
    touched = {
        "vertex": a,
        "edge": a + (b - a) * random.uniform(0.0, 1.0, (count, 1)),
        "edge's line": a + (b - a) * random.uniform(1.0, 1.2, (count, 1)),
        "interior": np.einsum("nk,nkc->nc", random.dirichlet([1, 1, 1], count), triangles),
    }[part]
    points = touched + gap * unit(random.normal(size=(count, 3)))
    assert_exact(points, unit(random.normal(size=(count, 3))), triangles)


@pytest.mark.parametrize("distance", [0.3, 2.0, 12.0, 60.0, 1e3])
def test_triangles_cut_by_the_horizon_against_fifty_digits(distance: float) -> None:
    random = np.random.default_rng(int(10 * distance))
    count = 300
    triangles = unit(random.normal(size=(count, 3, 3)))
    points = distance * unit(random.normal(size=(count, 3)))
    # Normals at right angles to the direction of a random point of the triangle.
    towards = np.einsum("nk,nkc->nc", random.dirichlet([1, 1, 1], count), triangles) - points
    exact = assert_exact(points, unit(np.cross(towards, random.normal(size=(count, 3)))), triangles)
    assert (exact > 0.0).sum() > count // 4


@pytest.mark.parametrize("vertices", [4, 6, 8])
def test_polygons_against_fifty_digits(vertices: int) -> None:
    random = np.random.default_rng(vertices)
    count = 200
    outlines = np.stack([octagon(2.0 ** -random.integers(0, 11))[:vertices] for _ in range(count)])
    points = 10.0 ** random.uniform(-1.0, 3.0, (count, 1)) * unit(random.normal(size=(count, 3)))
    assert_exact(points, unit(random.normal(size=(count, 3))), outlines)


@pytest.mark.parametrize("name", HARD_CASES)
def test_hard_case_against_fifty_digits(name: str) -> None:
    case = HARD_CASES[name]
    for polygon in case.polygons:
        value, exact = one(case.point, case.normal, polygon), exact_form_factor(case.point, case.normal, polygon)
        assert value == pytest.approx(exact, rel=ORACLE_RELATIVE, abs=ORACLE_ABSOLUTE)


@pytest.mark.parametrize("name", [name for name, case in HARD_CASES.items() if case.limit is not None])
def test_hard_case_against_its_limit(name: str) -> None:
    case = HARD_CASES[name]
    total = sum(one(case.point, case.normal, polygon) for polygon in case.polygons)
    if case.limit == 0.0:
        assert total == 0.0
    else:
        assert total == pytest.approx(case.limit, abs=case.within + ORACLE_ABSOLUTE)


@pytest.mark.parametrize("name", HARD_CASES)
def test_hard_case_in_float32(name: str) -> None:
    """The same code in float32 keeps FLOAT32_ABSOLUTE even in contact, thanks to the doubled digits."""
    case = HARD_CASES[name]
    value = summed(case, lambda *pairs: paired_form_factor(*pairs, dtype=np.float32))
    if case.limit == 0.0:
        assert value == 0.0
    else:
        assert value == pytest.approx(case.exact(), abs=FLOAT32_ABSOLUTE)


def test_float32_bound_is_what_rounding_takes() -> None:
    """Offsets moved by half a unit move the 50-digit result by less than the bound, and by a tenth of it somewhere."""
    random = np.random.default_rng(4)
    used = []
    for case in HARD_CASES.values():
        for triangle in case.triangles():
            exact = exact_form_factor(case.point, case.normal, triangle)
            bound = float(float32_bound(*case.pairs(triangle[None]))[0])
            offsets = triangle - case.point
            for _ in range(PERTURBATIONS if 2 * FLOAT32_ABSOLUTE < bound < 1.0 else 1):
                signs = random.choice([-1.0, 1.0], offsets.shape)
                moved = offsets + FLOAT32_UNIT * np.linalg.norm(offsets, axis=-1, keepdims=True) * signs
                changed = abs(exact_form_factor(np.zeros(3), case.normal, moved) - exact)
                assert changed <= bound
                used.append(changed / bound if bound < 1.0 else 0.0)
    assert max(used) > 0.1


def test_definition_as_an_area_integral() -> None:
    """The edge sum equals the integral of cos cos' / (pi d^2), also where the horizon cuts the polygon."""
    point, normal = np.array([0.2, 0.1, 0.8]), unit(np.array([0.9, 0.0, -0.3]))
    x = (np.arange(1500) + 0.5) / 1500 - 0.5
    grid = np.stack([*np.meshgrid(x, x), np.zeros((1500, 1500))], axis=-1) - point
    squared = (grid**2).sum(-1)
    integrand = np.maximum(grid @ normal, 0.0) * point[2] / (np.pi * squared**2)
    assert one(point, normal, SQUARE) == pytest.approx(integrand.mean(), abs=1e-6)


@pytest.mark.parametrize("sliver", [1e-3, 1e-7])
def test_slivers_give_no_more_than_their_area(sliver: float) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, sliver, 0.0]])
    assert 0.0 < one([0.2, 0.1, 1.0], DOWN, triangle) <= 0.5 * sliver / np.pi


def test_repeated_vertices_change_nothing() -> None:
    point, normal = [0.3, -0.2, 0.7], unit(np.array([0.5, 0.2, -0.4]))
    repeated = SQUARE[[0, 0, 1, 2, 2, 3]]
    assert one(point, normal, repeated) == pytest.approx(one(point, normal, SQUARE), rel=1e-13)


@pytest.mark.parametrize("distance", [1e2, 1e3, 1e4, 1e6])
def test_far_polygons_follow_the_inverse_square(distance: float) -> None:
    direction = unit(np.array([0.3, 0.4, 0.8]))
    normal = unit(np.array([0.1, -0.3, -1.0]))
    expected = -(normal @ direction) * direction[2] / (np.pi * distance**2)
    # A square seen from its axis of symmetry differs in the second order only; 10 covers its coefficient.
    assert one(distance * direction, normal, SQUARE) / expected == pytest.approx(1.0, abs=10 / distance**2 + 1e-12)


@pytest.mark.parametrize("corner", [1, 2])
def test_rotating_the_vertices_changes_nothing(corner: int) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 0.9, -0.2]])
    point, normal = [0.5, 0.5, 1.0], unit(np.array([0.3, 0.1, -0.6]))
    rotated = np.roll(triangle, corner, axis=0)
    assert one(point, normal, rotated) == pytest.approx(one(point, normal, triangle), rel=1e-13)


def test_splitting_a_triangle_leaves_the_sum() -> None:
    a, b, c = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 0.9, -0.2]])
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
    point, normal = np.array([[0.5, 0.5, 0.4]]), unit(np.array([[0.9, 0.1, -0.2]]))
    split = polygon_form_factor(point, normal, parts).sum()
    assert split == pytest.approx(one(point[0], normal[0], [a, b, c]), rel=1e-12)


@given(
    st.tuples(*[st.floats(1e-20, 1.0, exclude_max=True)] * 3),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: np.linalg.norm(n) > 1e-2),
)
@settings(max_examples=200, deadline=None)
def test_closed_box_fills_the_hemisphere(point: tuple[float, ...], normal: tuple[float, ...]) -> None:
    total = polygon_form_factor(np.array([point]), unit(np.array([normal])), CUBE).sum()
    assert total == pytest.approx(1.0, abs=1e-13)


COORDINATE = st.one_of(
    st.floats(-10.0, 10.0, width=32),
    st.sampled_from([0.0, 1.0, -1.0, 1e-20, -1e-20, 1e-7, 1e12, -1e12]),
)


@given(
    st.tuples(*[COORDINATE] * 3),
    st.tuples(*[st.floats(-1.0, 1.0, width=32)] * 3).filter(lambda n: np.linalg.norm(n) > 1e-2),
    st.tuples(*[COORDINATE] * 9),
)
@settings(max_examples=200, deadline=None)
def test_any_triangle_gives_a_share_in_both_widths(
    point: tuple[float, ...], normal: tuple[float, ...], coordinates: tuple[float, ...]
) -> None:
    points, normals = single([point]), single(unit([normal]))
    triangles = single(coordinates).reshape(1, 3, 3)
    for dtype in (np.float64, np.float32):
        value = paired_form_factor(points, normals, triangles, dtype)[0]
        assert 0.0 <= value <= 1.0


@pytest.mark.parametrize(("face", "expected"), [(5, 0.1998), (0, 0.2000), (3, 0.2000)])
def test_unit_cube_face_to_face(face: int, expected: float) -> None:
    """Known exchange factors of the cube: 0.1998 opposite, 0.2000 adjacent."""
    assert exchange(CUBE[4], CUBE[face]) == pytest.approx(expected, abs=5e-5)


def exchange(sender: np.ndarray, receiver: np.ndarray) -> float:
    """Mean form factor of a parallelogram `receiver` over a parallelogram `sender`, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    u, v = (0.5 * (grid.ravel() + 1.0) for grid in np.meshgrid(nodes, nodes))
    sides = sender[1] - sender[0], sender[3] - sender[0]
    points = sender[0] + u[:, None] * sides[0] + v[:, None] * sides[1]
    normals = np.tile(unit(np.cross(*sides)), (len(points), 1))
    return float(0.25 * np.outer(weights, weights).ravel() @ polygon_form_factor(points, normals, receiver[None])[:, 0])


def test_reciprocity_of_areas() -> None:
    """A F(A to B) = B F(B to A) (seed 002, 2.3), for parallelograms of unequal area that face each other askew."""
    large = SQUARE * 2.0
    small = SQUARE[::-1] @ np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]).T + [0.3, 0.2, 1.5]
    assert 4.0 * exchange(large, small) == pytest.approx(1.0 * exchange(small, large), rel=1e-9)


@pytest.mark.parametrize("scale", [1e-150, 1e-4, 1e4, 1e150])
def test_scale_changes_nothing(scale: float) -> None:
    point, normal = np.array([0.3, -0.2, 0.7]), unit(np.array([0.5, 0.2, -0.4]))
    assert one(point * scale, normal, SQUARE * scale) == pytest.approx(one(point, normal, SQUARE), rel=1e-13)


@pytest.mark.parametrize("shift", [2.0**13, 2.0**20])
def test_translation_changes_nothing(shift: float) -> None:
    point, normal = np.array([0.25, -0.125, 0.75]), unit(np.array([0.5, 0.2, -0.4]))
    assert one(point + shift, normal, SQUARE + shift) == one(point, normal, SQUARE)


def test_sweep_over_the_horizon_has_no_step() -> None:
    angles = np.linspace(0.0, np.pi, 2001)
    normals = np.stack([np.sin(angles), np.zeros_like(angles), -np.cos(angles)], axis=-1)
    values = polygon_form_factor(np.tile([0.0, 0.0, 0.05], (len(angles), 1)), normals, SQUARE[None])[:, 0]
    assert np.abs(np.diff(values)).max() < 1.1 * (angles[1] - angles[0])


@pytest.mark.parametrize("distance", [0.05, 1.0, 10.0, 40.0, 1e3])
def test_vector_form_factor_gives_every_unclipped_one(distance: float) -> None:
    random = np.random.default_rng(6)
    triangles = unit(random.normal(size=(500, 3, 3)))
    points = distance * unit(random.normal(size=(500, 3)))
    vectors = paired_vector_form_factor(points, triangles)
    normals = unit(random.normal(size=(500, 3)))
    whole = (np.einsum("nkc,nc->nk", triangles - points[:, None], normals) > 0.0).all(-1)
    values = paired_form_factor(points, normals, triangles)
    dots = np.einsum("nc,nc->n", vectors, normals)
    assert whole.sum() > 20
    np.testing.assert_allclose(dots[whole], values[whole], rtol=1e-9, atol=1e-15 / distance**2)
    front = vectors.any(-1)
    area_vectors = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert ((np.einsum("nc,nc->n", area_vectors, points - triangles[:, 0]) > 0.0) == front).all()


def test_vector_form_factor_in_contact_points_at_the_polygon() -> None:
    """Over a hemisphere the vector irradiance of constant radiance has the length of a full form factor."""
    (vector,) = paired_vector_form_factor([[0.1, 0.2, 1e-9]], SQUARE[None])
    np.testing.assert_allclose(vector, [0.0, 0.0, -1.0], atol=1e-8)


@pytest.mark.parametrize(
    ("points", "normals", "polygons"),
    [
        ([[np.nan, 0, 0]], [[0, 0, 1.0]], SQUARE[None]),
        ([[0, 0, 0.0]], [[0, 0, np.inf]], SQUARE[None]),
        ([[0, 0, 0.0]], [[0, 0, 0.0]], SQUARE[None]),
        ([[0, 0, 0.0]], [[0, 0, 1.0]], SQUARE[None, :2]),
        ([[0, 0, 0.0]], [[0, 0, 1.0]], np.zeros((1, 9, 3))),
        ([[0, 0, 0.0], [1, 0, 0]], [[0, 0, 1.0]], SQUARE[None]),
        ([[0, 0, "high"]], [[0, 0, 1.0]], SQUARE[None]),
        ([[0, 0, 10**400]], [[0, 0, 1.0]], SQUARE[None]),
        ([[0, 0, 1j]], [[0, 0, 1.0]], SQUARE[None]),
        ([[0, 0, 0.0]], [[0, 0, 1.0]], [[[0, 0, 0], [1, 0]]]),
    ],
    ids=[
        "nan",
        "infinity",
        "no normal",
        "two vertices",
        "nine vertices",
        "lengths differ",
        "a word",
        "too large",
        "complex",
        "ragged",
    ],
)
def test_bad_input_is_refused(points: object, normals: object, polygons: object) -> None:
    with pytest.raises(InvalidInput):
        polygon_form_factor(points, normals, polygons)


@pytest.mark.parametrize("length", [1e-320, 1e-200, 0.5, 1e200])
def test_length_of_the_normal_does_not_matter(length: float) -> None:
    normal = np.array([0.0, 0.0, -1.0])
    value = one([0.1, 0.2, 0.8], length * normal, SQUARE)
    assert value == pytest.approx(one([0.1, 0.2, 0.8], normal, SQUARE), rel=1e-14)


def test_ragged_points_of_the_vector_form_are_refused() -> None:
    with pytest.raises(InvalidInput):
        paired_vector_form_factor([[0, 0, 0], [1, 0]], SQUARE[None])  # type: ignore[list-item]


def test_pairs_of_unequal_count_are_refused() -> None:
    with pytest.raises(InvalidInput, match="2 points for 1 polygons"):
        paired_form_factor(np.zeros((2, 3)), np.tile(DOWN, (2, 1)), SQUARE[None])
