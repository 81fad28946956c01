# SPDX-License-Identifier: GPL-3.0-or-later
"""What form factors are held to: 50 digits, a float32 error bound, and the named hard cases.

All numbers of the cases are float32, so that every implementation is asked the same question.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
from mpmath import mpf

Array = np.ndarray
MpVector = tuple[mpf, mpf, mpf]

DIGITS = 50
ORACLE_RELATIVE, ORACLE_ABSOLUTE = 1e-12, 1e-14
FLOAT32_ABSOLUTE = 1e-6
FLOAT32_UNIT = 2.0**-24
"""Half a unit in the last place, relative."""


def single(array: object) -> Array:
    """The nearest float32 numbers, as float64."""
    return np.asarray(array, np.float32).astype(np.float64)


def unit(vectors: object) -> Array:
    vectors = np.asarray(vectors, np.float64)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# --- 50 digits ------------------------------------------------------------------------------------------------------


def exact_form_factor(point: Array, normal: Array, polygon: Array) -> float:
    """Eq. 3.1 of seed 002 after clipping at the horizon, for the very numbers given. The normal counts as unit."""
    with mpmath.workdps(DIGITS):
        n = _long(normal)
        corners = [_minus(_long(vertex), _long(point)) for vertex in polygon]
        area = _sum(_cross(_minus(a, corners[0]), _minus(b, corners[0])) for a, b in itertools.pairwise(corners[1:]))
        if _dot(area, corners[0]) >= 0:
            return 0.0
        outline = list(_clipped(corners, [_dot(n, corner) for corner in corners]))
        total = -_dot(n, _sum(_edge(a, b) for a, b in zip(outline, outline[1:] + outline[:1], strict=True)))
        return float(total / (2 * mpmath.pi * mpmath.sqrt(_dot(n, n))))


def _clipped(corners: Sequence[MpVector], heights: Sequence[mpf]) -> Iterator[MpVector]:
    for a, b, height_a, height_b in zip(
        corners, [*corners[1:], corners[0]], heights, [*heights[1:], heights[0]], strict=True
    ):
        if height_a >= 0:
            yield a
        if height_a * height_b < 0:
            share = height_a / (height_a - height_b)
            yield a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share


def _edge(a: MpVector, b: MpVector) -> MpVector:
    """Angle between a and b along the unit normal of their plane."""
    c = _cross(a, b)
    length = mpmath.sqrt(_dot(c, c))
    weight = mpmath.atan2(length, _dot(a, b)) / length if length > 0 else mpf(0)
    return c[0] * weight, c[1] * weight, c[2] * weight


def _long(vector: Array) -> MpVector:
    x, y, z = (mpf(float(component)) for component in vector)
    return x, y, z


def _sum(vectors: Iterable[MpVector]) -> MpVector:
    x = y = z = mpf(0)
    for vector in vectors:
        x, y, z = x + vector[0], y + vector[1], z + vector[2]
    return x, y, z


def _minus(a: MpVector, b: MpVector) -> MpVector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _dot(a: MpVector, b: MpVector) -> mpf:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: MpVector, b: MpVector) -> MpVector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


# --- what float32 can hold --------------------------------------------------------------------------------------------


def float32_bound(points: Array, normals: Array, polygons: Array) -> Array:
    """(m,) how far a float32 evaluation may be off. points, normals: (m, 3); polygons: (m, k, 3), all float32.

    FLOAT32_ABSOLUTE, and what conditioning takes: `vertex - point` is rounded by half a unit of its length (times
    sqrt 3 for three axes), which turns the plane through an edge and the point by that over the point's distance from
    the edge. An edge adds its angle (at most pi) times the cosine to that plane's normal, over 2 pi. Where an edge
    touches the point, or the point the polygon's plane within that rounding, this says nothing, and the bound is 1.
    """
    a = polygons - points[:, None]
    b = np.roll(a, -1, axis=1)
    span = b - a
    square = (span * span).sum(-1)
    along = np.clip(-(a * span).sum(-1) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    distance = np.linalg.norm(a + along[..., None] * span, axis=-1)
    reach = np.maximum(np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))
    moved = np.sqrt(3.0) * FLOAT32_UNIT * reach
    turned = np.divide(moved, distance, out=np.full_like(distance, np.inf), where=distance > 0)
    bound = np.minimum(1.0, FLOAT32_ABSOLUTE + 0.5 * turned.sum(-1))
    plane_normals = np.cross(span[:, 0], span[:, 1])
    depths = np.abs((plane_normals * a[:, 0]).sum(-1))
    # The stored plane and the offset are rounded alike.
    in_contact = depths <= 2.0 * moved.max(-1) * np.linalg.norm(plane_normals, axis=-1)
    return np.where(in_contact, 1.0, bound)


# --- named cases ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class HardCase:
    """A point with a normal, and polygons whose form factors are summed.

    limit: what geometry says, where a closed form or a limit exists. within: how far the numbers given are from it.
    """

    point: Array
    normal: Array
    polygons: tuple[Array, ...]
    limit: float | None = None
    within: float = 0.0

    def exact(self) -> float:
        """The sum at 50 digits."""
        return sum(exact_form_factor(self.point, self.normal, polygon) for polygon in self.polygons)

    def triangles(self) -> Array:
        """(t, 3, 3) the polygons as fans."""
        return np.array([p[[0, i, i + 1]] for p in self.polygons for i in range(1, len(p) - 1)])

    def pairs(self, polygons: Array) -> tuple[Array, Array, Array]:
        """The point and its normal repeated for each of `polygons`."""
        count = len(polygons)
        return np.tile(self.point, (count, 1)), np.tile(self.normal, (count, 1)), polygons


def hard_case(
    point: object, normal: object, *polygons: object, limit: float | None = None, within: float = 0.0
) -> HardCase:
    """A HardCase of float32 numbers; the normal is made unit length."""
    return HardCase(single(point), single(unit(normal)), tuple(single(p) for p in polygons), limit, within)


SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
"""Unit square that emits upwards."""
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)

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


def room(cuts: int) -> Array:
    """(12 cuts², 3, 3) a unit cube seen from inside, its faces cut into a grid of cells of two triangles."""
    x = np.linspace(0.0, 1.0, cuts + 1)
    low, high = np.meshgrid(x[:-1], x[:-1], indexing="ij"), np.meshgrid(x[1:], x[1:], indexing="ij")
    (u0, v0), (u1, v1) = ([axis.ravel() for axis in pair] for pair in (low, high))
    zero = np.zeros_like(u0)
    quad = [np.stack(corner, axis=-1) for corner in ((u0, v0, zero), (u1, v0, zero), (u1, v1, zero), (u0, v1, zero))]
    floor = np.concatenate([np.stack([quad[i] for i in tri], axis=1) for tri in ((0, 1, 2), (0, 2, 3))])
    mirrored = np.array([1.0, 1.0, -1.0]) * floor[:, ::-1] + [0.0, 0.0, 1.0]
    return np.concatenate([np.roll(faces, axis, axis=-1) for axis in range(3) for faces in (floor, mirrored)])


def wall(extent: float) -> Array:
    """A wall that stands on the floor z = 0 at y = 0 and shines towards negative y."""
    return np.array([[-extent, 0, 0], [extent, 0, 0], [extent, 0, extent], [-extent, 0, extent]], float)


def parallel_square(height: float) -> float:
    """Form factor of the unit square from `height` over its centre, facing it (Howell, catalogue B-4)."""
    x = 0.5 / height
    root = np.sqrt(1.0 + x * x)
    return float(4.0 * (x / root) * np.arctan(x / root) / np.pi)


def _contact() -> dict[str, HardCase]:
    cases = {}
    for height in (1e-1, 1e-3, 1e-6, 1e-12, 1e-30):
        cases[f"contact from above, h = {height:g}"] = hard_case(
            (0.0, 0.0, height), DOWN, SQUARE, limit=parallel_square(single(height)), within=1e-12
        )
    tilted = TRIANGLE @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]).T
    cases["contact with the horizon through it"] = hard_case((0.05, 0.4, 2e-6), (1.0, 0.5, -0.25), tilted)
    cases["a wall meets the floor"] = hard_case((0.0, -(2.0**-20), 0.0), UP, wall(1e4), limit=0.5, within=1e-9)
    cases["a floor meets the wall's foot from 1e-12"] = hard_case(
        (0.1, -1e-12, 0.0), UP, wall(1.0), limit=0.5, within=1e-9
    )
    return cases


def _huge_and_tiny() -> dict[str, HardCase]:
    return {
        "huge parallel plane": hard_case((0.0, 0.0, 1.0), DOWN, SQUARE * 2.0**20, limit=1.0, within=1e-11),
        "huge perpendicular half-plane": hard_case(
            (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), SQUARE * 2.0**24, limit=0.5, within=1e-6
        ),
        "tiny triangle at its own distance": hard_case((1e-6, 1e-6, 1e-6), DOWN, 1e-6 * TRIANGLE),
        "far triangle, d/s = 1e6": hard_case((0.0, 6e5, 8e5), (0.0, -0.6, -0.8), TRIANGLE),
        "far triangle cut by the horizon": hard_case((0.0, 3e2, 4e2), unit((0.8, -0.6 * 0.9985, 0.45)), TRIANGLE),
    }


def _exactly_zero() -> dict[str, HardCase]:
    cases = {
        "behind": ((0.2, 0.2, -1.0), UP),
        "in the plane": ((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        "inside the triangle": ((0.25, 0.25, 0.0), DOWN),
        "on a vertex": ((1.0, 0.0, 0.0), DOWN),
        "on an edge": ((0.5, 0.0, 0.0), DOWN),
        "collinear outside": ((3.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        "wholly under the horizon": ((0.2, 0.2, 1.0), UP),
        "an edge on the horizon, the rest under it": ((0.0, 0.2, 1.0), (-1.0, 0.0, 0.0)),
        "a vertex on the horizon, the rest under it": ((1.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    }
    zero = {name: hard_case(point, normal, TRIANGLE, limit=0.0) for name, (point, normal) in cases.items()}
    zero["flipped winding"] = hard_case((0.2, 0.2, 1.0), DOWN, TRIANGLE[::-1], limit=0.0)
    zero["no area, collinear"] = hard_case((0.2, 0.2, 1.0), DOWN, [[0, 0, 0], [1, 0, 0], [2, 0, 0]], limit=0.0)
    zero["no area, doubled vertex"] = hard_case((0.2, 0.2, 1.0), DOWN, TRIANGLE[[0, 1, 1]], limit=0.0)
    zero["no area, one point"] = hard_case((0.2, 0.2, 1.0), DOWN, np.zeros((3, 3)), limit=0.0)
    zero["no area, at the point itself"] = hard_case((0.0, 0.0, 0.0), DOWN, np.zeros((3, 3)), limit=0.0)
    return zero


def _horizon() -> dict[str, HardCase]:
    return {
        "a vertex on the horizon": hard_case((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), TRIANGLE),
        "an edge on the horizon, the rest above": hard_case((0.0, 0.2, 0.5), (1.0, 0.0, 0.0), TRIANGLE),
        "one vertex above": hard_case((0.75, 0.0, 0.3), (1.0, 0.0, 0.0), TRIANGLE),
        "two vertices above": hard_case((0.25, 0.0, 0.3), (1.0, 1.0, 0.0), TRIANGLE),
        "a vertex above by 1e-7": hard_case((1.0 - 2.0**-23, 0.0, 0.5), (1.0, 0.0, 0.0), TRIANGLE),
        "an edge above by 1e-7": hard_case((-(2.0**-23), 0.5, 0.5), (-1.0, 0.0, 0.0), TRIANGLE - [1.0, 0, 0]),
    }


def _edges_and_vertices() -> dict[str, HardCase]:
    cases = {}
    for power in (10, 16, 20, 23):
        near = 2.0**-power
        cases[f"2^-{power} over an edge"] = hard_case((0.5, 0.0, near), DOWN, TRIANGLE)
        cases[f"2^-{power} beside an edge, as high"] = hard_case((0.5, -near, near), (0.0, 0.6, -0.8), TRIANGLE)
        cases[f"2^-{power} over a vertex"] = hard_case((1.0, 0.0, near), (-0.6, 0.0, -0.8), TRIANGLE)
        cases[f"2^-{power} from the hypotenuse"] = hard_case((0.5, 0.5 - near, near), (-0.6, 0.0, -0.8), TRIANGLE)
    return cases


def _slivers() -> dict[str, HardCase]:
    cases = {}
    for width in (1e-3, 1e-5, 1e-7):
        sliver = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, width, 0.0]])
        cases[f"sliver of {width:g} from a metre"] = hard_case((0.2, 0.1, 1.0), DOWN, sliver)
        cases[f"sliver of {width:g} from its own width"] = hard_case((0.5, 0.0, width), DOWN, sliver)
        cases[f"sliver of {width:g} edge-on"] = hard_case((0.5, 3.0, 0.01), (0.0, -1.0, 0.0), sliver)
    return cases


def _closed() -> dict[str, HardCase]:
    return {
        "cube from its centre": hard_case((0.5, 0.5, 0.5), (0.3, -0.5, 0.8), *CUBE, limit=1.0, within=1e-7),
        "cube from a corner": hard_case((2.0**-20, 2.0**-20, 2.0**-20), (0.5, 0.5, 0.7), *CUBE, limit=1.0, within=1e-7),
    }


HARD_CASES: dict[str, HardCase] = {
    **_contact(),
    **_huge_and_tiny(),
    **_exactly_zero(),
    **_horizon(),
    **_edges_and_vertices(),
    **_slivers(),
    **_closed(),
}

Evaluate = Callable[[Array, Array, Array], Array]


def summed(case: HardCase, evaluate: Evaluate) -> float:
    """The case's polygons as triangles through `evaluate(points, normals, triangles)`, added in float64."""
    return float(evaluate(*case.pairs(case.triangles())).astype(np.float64).sum())


def summed_bound(case: HardCase) -> float:
    """float32_bound of the sum."""
    return float(float32_bound(*case.pairs(case.triangles())).sum())
