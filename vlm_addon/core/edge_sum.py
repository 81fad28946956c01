# SPDX-License-Identifier: GPL-3.0-or-later
"""The form factor of a polygon as a sum over its edges (Baum, Rushmeier and Winget 1989; seed 002, eq. 3.1).

Each edge gives the angle under which it is seen, along the unit normal of the plane through it and the point. That
normal loses digits where the edge passes close by; such pairs are computed again with twice the digits,
enough for gaps down to 1e-30 of an edge's length.

Vectors are three arrays, one for each axis, so that the same code runs on plain and on long numbers.
"""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

import numpy as np

from .double_double import Array, DoubleDouble, difference, double_double, quotient

# An obtuse edge that passes the point at less than this share of its ends' distances has lost digits.
_NEAR_EDGE = 0.05

Number = TypeVar("Number", Array, DoubleDouble)
Item = TypeVar("Item")
Vector = tuple[Number, Number, Number]


class _Edge(NamedTuple, Generic[Number]):
    """The part of an edge above the horizon, seen from the point. seen: (m,) bool, whether there is one."""

    start: Vector[Number]
    stop: Vector[Number]
    seen: Array


class _Outline(NamedTuple, Generic[Number]):
    """The polygon above the horizon. Where `is_cut`, an arc along the horizon joins the last two points."""

    edges: list[_Edge[Number]]
    exit_point: Vector[Number]
    entry_point: Vector[Number]
    is_cut: Array


def clipped_edge_sum(points: Array, normals: Array, polygons: Array) -> Array:
    """(m,) form factors, not yet clamped, of pairs in front of the polygon. polygons: (m, k, 3)."""
    corners = _corners(points, polygons)
    total = _clipped_sum(corners, _components(normals), normals)
    doubtful = np.flatnonzero(_passes_edge(corners))
    if len(doubtful):
        accurate = _accurate_corners(points[doubtful], polygons[doubtful])
        x, y, z = (double_double(component) for component in _components(normals[doubtful]))
        total[doubtful] = _clipped_sum(accurate, (x, y, z), normals[doubtful])
    return total


def edge_sum_vector(points: Array, polygons: Array) -> Array:
    """(m, 3) vector form factors, towards the polygon, of pairs in front of it."""
    corners = _corners(points, polygons)
    total = _vector_sum(corners)
    doubtful = np.flatnonzero(_passes_edge(corners))
    if len(doubtful):
        total[doubtful] = _vector_sum(_accurate_corners(points[doubtful], polygons[doubtful]))
    return total


def clipped_chain(points: Array, normals: Array, polygons: Array) -> Array:
    """(m, 2 k, 3) the part above the horizon as a closed chain from the first vertex, not seen from the point: far
    points would round it away. Vertices repeat."""
    spans = polygons - polygons[:, :1]
    first_heights = ((polygons[:, 0] - points) * normals).sum(-1)
    heights = [(spans[:, k] * normals).sum(-1) + first_heights for k in range(polygons.shape[1])]
    outline = _clip([_components(spans[:, k]) for k in range(polygons.shape[1])], heights)
    # A convex outline dips below the horizon once: its hidden edges collapse onto the point where it does.
    ends = [_choose(edge.seen, end, outline.exit_point) for edge in outline.edges for end in (edge.start, edge.stop)]
    return np.stack([np.stack(end, axis=-1) for end in ends], axis=1)


def along(vectors: Array, normals: Array) -> Array:
    """(m,) `vectors` along `normals`, whose lengths do not matter."""
    return np.asarray((vectors * normals).sum(-1) / np.sqrt((normals * normals).sum(-1)))


def _components(vectors: Array) -> Vector[Array]:
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _corners(points: Array, polygons: Array) -> list[Vector[Array]]:
    return [_components(polygons[:, k] - points) for k in range(polygons.shape[1])]


def _accurate_corners(points: Array, polygons: Array) -> list[Vector[DoubleDouble]]:
    corners = [difference(polygons[:, k], points) for k in range(polygons.shape[1])]
    return [(corner[:, 0], corner[:, 1], corner[:, 2]) for corner in corners]


def _passes_edge(corners: list[Vector[Array]]) -> Array:
    """(m,) whether the plane through the point and some edge has lost digits."""
    result = np.zeros(len(corners[0][0]), bool)
    for a, b in _pairs(corners):
        c = _normal(a, b)
        result |= (_dot(a, b) < 0.0) & (_dot(c, c) < _NEAR_EDGE**2 * _dot(a, a) * _dot(b, b))
    return result


def _clipped_sum(corners: list[Vector[Number]], normal: Vector[Number], receiver_normals: Array) -> Array:
    """Irradiance of the outline above the horizon; receiver_normals: (m, 3), `normal` as plain numbers."""
    outline = _clip(corners, [_dot(corner, normal) for corner in corners])
    vector = np.zeros_like(receiver_normals)
    for edge in outline.edges:
        vector += np.where(edge.seen[:, None], _edge_vector(edge.start, edge.stop), 0.0)
    # The arc along the horizon bounds the cosine-weighted disk from outside, so it always adds its whole angle.
    arc = np.where(outline.is_cut, _angle(outline.exit_point, outline.entry_point), 0.0)
    return (along(vector, receiver_normals) + arc) / (2.0 * np.pi)


def _vector_sum(corners: list[Vector[Number]]) -> Array:
    return np.asarray(sum(_edge_vector(a, b) for a, b in _pairs(corners)) / (2.0 * np.pi))


def _clip(corners: list[Vector[Number]], heights: list[Number]) -> _Outline[Number]:
    above = [_plain(height) > 0.0 for height in heights]
    exit_point = entry_point = corners[0]
    edges = []
    for (a, b), (height_a, height_b), (a_above, b_above) in zip(
        _pairs(corners), _pairs(heights), _pairs(above), strict=True
    ):
        at_horizon = _at_horizon(a, b, height_a, height_b, a_above != b_above)
        edges.append(_Edge(_choose(a_above, a, at_horizon), _choose(b_above, b, at_horizon), a_above | b_above))
        exit_point = _choose(a_above & ~b_above, at_horizon, exit_point)
        entry_point = _choose(~a_above & b_above, at_horizon, entry_point)
    is_cut = np.any(above, axis=0) & ~np.all(above, axis=0)
    return _Outline(edges, exit_point, entry_point, is_cut)


def _at_horizon(
    a: Vector[Number], b: Vector[Number], height_a: Number, height_b: Number, crosses: Array
) -> Vector[Number]:
    """Where an edge that crosses the horizon meets it; anything for other edges."""
    # From the end that is closer to the horizon, which may be a corner that almost touches the point.
    a_closer = np.abs(_plain(height_a)) < np.abs(_plain(height_b))
    share = _ratio(_select(a_closer, height_a, height_b), height_a - height_b, crosses)
    base = _choose(a_closer, a, b)
    return base[0] + (b[0] - a[0]) * share, base[1] + (b[1] - a[1]) * share, base[2] + (b[2] - a[2]) * share


def _edge_vector(a: Vector[Number], b: Vector[Number]) -> Array:
    """(m, 3) angle between a and b times the unit normal of their plane, on the polygon's side; 0 without an angle."""
    normal = np.stack([_plain(component) for component in _normal(a, b)], axis=-1)
    length = np.sqrt((normal * normal).sum(-1))
    # Seen from the emitting side the outline runs against the hand of its cross products, hence the minus.
    scale = -np.divide(np.arctan2(length, _plain(_dot(a, b))), length, out=np.zeros_like(length), where=length > 0.0)
    return np.asarray(normal * scale[:, None])


def _angle(a: Vector[Number], b: Vector[Number]) -> Array:
    normal = [_plain(component) for component in _normal(a, b)]
    length = np.sqrt(sum(component * component for component in normal))
    return np.asarray(np.arctan2(length, _plain(_dot(a, b))))


def _normal(a: Vector[Number], b: Vector[Number]) -> Vector[Number]:
    """a x b, from the span between them and the shorter of them: accurate for close and for unequal vectors."""
    x, y, z = _choose(_plain(_dot(a, a)) < _plain(_dot(b, b)), a, b)
    sx, sy, sz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return y * sz - z * sy, z * sx - x * sz, x * sy - y * sx


def _dot(a: Vector[Number], b: Vector[Number]) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _plain(value: Number) -> Array:
    return value.high if isinstance(value, DoubleDouble) else value


def _choose(condition: Array, yes: Vector[Number], no: Vector[Number]) -> Vector[Number]:
    x, y, z = (_select(condition, a, b) for a, b in zip(yes, no, strict=True))
    return x, y, z


def _select(condition: Array, yes: Number, no: Number) -> Number:
    if isinstance(yes, DoubleDouble):
        return DoubleDouble(np.where(condition, yes.high, no.high), np.where(condition, yes.low, no.low))
    return np.where(condition, yes, no)


def _ratio(a: Number, b: Number, where: Array) -> Number:
    """a / b, 0 elsewhere."""
    zero = np.zeros_like(_plain(a))
    safe = np.where(where, _plain(b), 1.0).astype(zero.dtype)
    if isinstance(a, DoubleDouble):
        return quotient(_select(where, a, double_double(zero)), DoubleDouble(safe, np.where(where, b.low, zero)))
    return np.where(where, a, zero) / safe


def _pairs(items: list[Item]) -> list[tuple[Item, Item]]:
    """Each item with the next around the outline."""
    return list(zip(items, [*items[1:], items[0]], strict=True))
