# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance from polygons of constant radiosity: the oracle of `gpu_shaders/lib/form_factor.glsl`.

Near polygons are summed edge by edge. The edges nearly cancel for far polygons, which are therefore integrated over
their area instead.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from .double_double import Array, DoubleDouble, difference
from .edge_sum import along, clipped_chain, clipped_edge_sum, edge_sum_vector
from .errors import InvalidInput
from .scene import Float64

MIN_VERTICES, MAX_VERTICES = 3, 8
_PAIRS_PER_BLOCK = 1 << 17
# (distance in bounding radii from which on it suffices, Gauss-Legendre points per direction). The error falls as
# (2 distance)^(-2 points); both rows leave less than 1e-14.
_QUADRATURE = ((200.0, 3), (16.0, 5))
# Height over the polygon's plane, in roundings of the distance to it, under which its sign is doubtful.
_DOUBTFUL_HEIGHT = 1e5


def polygon_form_factor(points: npt.ArrayLike, normals: npt.ArrayLike, polygons: npt.ArrayLike) -> Float64:
    """Share of the hemisphere over each point that each polygon fills, cosine-weighted, clipped at the horizon.

    points, normals: (p, 3), metres and directions. polygons: (q, k, 3), convex, plane, 3 to 8 vertices,
    counter-clockwise as seen from the emitting side; repeated vertices are allowed. Returns (p, q) float64 in [0, 1]:
    irradiance over radiosity. Exactly 0 behind the polygon, in its plane and where it is wholly under the horizon.
    Raises InvalidInput for NaN, infinity, what is not a number, and other shapes.
    """
    points, normals, polygons = _validated(points, normals, polygons, np.float64)
    result = np.zeros((len(points), len(polygons)))
    rows = max(1, _PAIRS_PER_BLOCK // max(1, len(polygons)))
    for start in range(0, len(points), rows):
        block = slice(start, start + rows)
        count = len(points[block])
        repeated_points = np.repeat(points[block], len(polygons), axis=0)
        repeated_normals = np.repeat(normals[block], len(polygons), axis=0)
        tiled = np.tile(polygons, (count, 1, 1))
        result[block] = _paired(repeated_points, repeated_normals, tiled).reshape(count, len(polygons))
    return result


def paired_form_factor(
    points: npt.ArrayLike, normals: npt.ArrayLike, polygons: npt.ArrayLike, dtype: npt.DTypeLike = np.float64
) -> npt.NDArray[Any]:
    """(p,) `polygon_form_factor` of point i and polygon i alone, computed in `dtype`; polygons: (p, k, 3)."""
    points, normals, polygons = _validated(points, normals, polygons, dtype)
    _require_pairs(points, polygons)
    return _paired(points, normals, polygons)


def paired_vector_form_factor(points: npt.ArrayLike, polygons: npt.ArrayLike) -> Float64:
    """(p, 3) float64: the vector irradiance of polygon i at point i over its radiosity, not clipped (Arvo 1994).

    Its dot product with a receiver's normal is the form factor where the whole polygon is above the horizon; its
    length bounds the form factor for such normals. It points towards the polygon and is 0 behind it and in its plane.
    Raises as `polygon_form_factor`.
    """
    points = _numbers("points", points, np.float64)
    points, _, polygons = _validated(points, np.ones_like(points), polygons, np.float64)
    _require_pairs(points, polygons)
    points, polygons = _scaled(points, polygons)
    faces = _faces_point(points, polygons)
    result = np.zeros_like(points)
    near, far = _by_distance(points, polygons, faces)
    for chosen, order in far:
        chain = polygons[chosen] - polygons[chosen, :1]
        result[chosen] = _integrated_vector(points[chosen], polygons[chosen], chain, order)
    result[near] = edge_sum_vector(points[near], polygons[near])
    return result


def _paired(points: Array, normals: Array, polygons: Array) -> Array:
    """(m,) form factors of m pairs."""
    points, polygons = _scaled(points, polygons)
    rises = (((polygons - points[:, None]) * normals[:, None]).sum(-1) > 0.0).any(-1)
    candidates = np.zeros(len(points), bool)
    candidates[rises] = _faces_point(points[rises], polygons[rises])
    result = np.zeros_like(points[:, 0])
    near, far = _by_distance(points, polygons, candidates)
    for chosen, order in far:
        chain = clipped_chain(points[chosen], normals[chosen], polygons[chosen])
        vector = _integrated_vector(points[chosen], polygons[chosen], chain, order)
        result[chosen] = along(vector, normals[chosen])
    result[near] = clipped_edge_sum(points[near], normals[near], polygons[near])
    return np.clip(result, 0.0, 1.0)


def _validated(
    points: npt.ArrayLike, normals: npt.ArrayLike, polygons: npt.ArrayLike, dtype: npt.DTypeLike
) -> tuple[Array, Array, Array]:
    points, normals, polygons = (
        _numbers(name, values, dtype)
        for name, values in (("points", points), ("normals", normals), ("polygons", polygons))
    )
    if points.ndim != 2 or points.shape[-1] != 3 or points.shape != normals.shape:
        problem = f"shapes {points.shape} and {normals.shape}"
        raise InvalidInput("form factor points and normals", problem, "give (p, 3) for both")
    longest = np.abs(normals).max(axis=-1, initial=0.0, keepdims=True)
    if (longest == 0.0).any():
        raise InvalidInput("form factor normals", "one has no length", "give unit normals")
    # Powers of two, so that nothing is rounded and squares stay in range.
    normals = np.ldexp(normals, -np.frexp(longest)[1])
    if polygons.ndim != 3 or polygons.shape[2] != 3 or not MIN_VERTICES <= polygons.shape[1] <= MAX_VERTICES:
        remedy = f"give (q, k, 3) with k from {MIN_VERTICES} to {MAX_VERTICES}"
        raise InvalidInput("form factor polygons", f"shape {polygons.shape}", remedy)
    return points, normals, polygons


def _numbers(name: str, values: npt.ArrayLike, dtype: npt.DTypeLike) -> Array:
    try:
        array = np.asarray(values, dtype)
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(f"form factor {name}", str(error), "give one regular array of numbers") from error
    if not np.isfinite(array).all():
        raise InvalidInput(f"form factor {name}", "not all values are finite", "remove NaN and infinity")
    return array


def _require_pairs(points: Array, polygons: Array) -> None:
    if len(points) != len(polygons):
        problem = f"{len(points)} points for {len(polygons)} polygons"
        raise InvalidInput("form factor pairs", problem, "give one polygon per point")


def _scaled(points: Array, polygons: Array) -> tuple[Array, Array]:
    """The same geometry with distances near 1, by powers of two, so that no product overflows or vanishes."""
    reach = np.abs(polygons - points[:, None]).max(axis=(1, 2), initial=0.0)
    exponents = -np.frexp(reach)[1]
    return np.ldexp(points, exponents[:, None]), np.ldexp(polygons, exponents[:, None, None])


def _area_vectors(polygons: Array) -> Array:
    """(m, 3) area times unit normal on the emitting side."""
    spans = polygons - polygons[:, :1]
    return np.asarray(0.5 * np.cross(spans[:, 1:-1], spans[:, 2:]).sum(axis=1))


def _faces_point(points: Array, polygons: Array) -> npt.NDArray[np.bool_]:
    """(m,) whether the point is strictly in front of the polygon's plane."""
    offsets = polygons - points[:, None]
    # The height over the plane rounds least from the nearest vertex when the point touches the polygon.
    nearest = (offsets * offsets).sum(-1).argmin(-1)
    arms = offsets[np.arange(len(points)), nearest]
    area_vectors = _area_vectors(polygons)
    depths = (arms * area_vectors).sum(-1)
    faces = depths < 0.0
    unit = _DOUBTFUL_HEIGHT * np.finfo(depths.dtype).eps
    spans = polygons - polygons[:, :1]
    scale = (spans * spans).sum(-1).max(-1) * np.sqrt((arms * arms).sum(-1))
    doubtful = np.flatnonzero(np.abs(depths) < unit * scale)
    faces[doubtful] = _accurate_depths(points[doubtful], polygons[doubtful], nearest[doubtful]) < 0.0
    return faces


def _accurate_depths(points: Array, polygons: Array, nearest: npt.NDArray[np.intp]) -> Array:
    """(m,) twice the area times the depth of the point behind the plane, of up to 32 digits in any dtype."""
    points, polygons = points.astype(np.float64), polygons.astype(np.float64)
    spans = [difference(polygons[:, k], polygons[:, 0]) for k in range(1, polygons.shape[1])]
    arms = difference(polygons[np.arange(len(points)), nearest], points)
    terms = [
        arms[:, i] * (a[:, j] * b[:, k] - a[:, k] * b[:, j])
        for a, b in itertools.pairwise(spans)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    total: DoubleDouble = terms[0]
    for term in terms[1:]:
        total = total + term
    return total.high


def _by_distance(points: Array, polygons: Array, candidates: Array) -> tuple[Array, list[tuple[Array, int]]]:
    """Indices of near pairs, and of far ones with the order of quadrature that suffices, among the candidates."""
    remaining = candidates.copy()
    centroids = polygons.mean(axis=1)
    radii = np.sqrt(((polygons - centroids[:, None]) ** 2).sum(-1).max(-1))
    distances = np.sqrt(((centroids - points) ** 2).sum(-1))
    far = []
    for least_distance, order in _QUADRATURE:
        chosen = remaining & (distances > least_distance * radii)
        far.append((np.flatnonzero(chosen), order))
        remaining &= ~chosen
    return np.flatnonzero(remaining), far


def _integrated_vector(points: Array, polygons: Array, chain: Array, order: int) -> Array:
    """(m, 3) vector form factors by Gauss quadrature over a fan of triangles: towards dA, cos' / (pi d^2) dA.

    chain: (m, c, 3), the outline to integrate over, from the polygon's first vertex.
    """
    nodes, node_weights = np.polynomial.legendre.leggauss(order)
    dtype = chain.dtype.type
    nodes, node_weights = dtype(0.5) * (nodes.astype(dtype) + 1), dtype(0.5) * node_weights.astype(dtype)
    area_vectors, first = _area_vectors(polygons), polygons[:, 0] - points
    areas = np.sqrt((area_vectors * area_vectors).sum(-1))
    unit = area_vectors / np.where(areas > 0.0, areas, 1.0)[:, None]
    total = np.zeros_like(chain[:, 0])
    for i in range(1, chain.shape[1] - 1):
        side, far_side = chain[:, i] - chain[:, 0], chain[:, i + 1] - chain[:, i]
        double_area = (np.cross(side, far_side) * unit).sum(-1)
        for u, u_weight in zip(nodes, node_weights, strict=True):
            for v, v_weight in zip(nodes, node_weights, strict=True):
                position = first + chain[:, 0] + u * (side + v * far_side)
                squared = (position * position).sum(-1)
                total += (u_weight * v_weight * u * double_area / (squared * squared))[:, None] * position
    # One plane distance for all points of the polygon: its own vertices agree on it only up to rounding.
    plane_distance = np.abs((first * unit).sum(-1))
    return np.asarray(total * plane_distance[:, None] / np.pi)
