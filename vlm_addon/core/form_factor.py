# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance from polygons of constant radiosity, in float64: the oracle of `gpu_shaders/lib/form_factor.glsl`.

Near polygons are summed edge by edge (Baum, Rushmeier and Winget 1989; seed 002, eq. 3.1): the angle under which an
edge is seen times the cosine between the receiver's normal and the plane through the edge and the point. The edges
nearly cancel for far polygons, which are therefore integrated over their area instead.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .scene import Float64

MIN_VERTICES, MAX_VERTICES = 3, 8
_PAIRS_PER_BLOCK = 1 << 17
# (distance in bounding radii from which on it suffices, Gauss-Legendre points per direction). The error falls as
# (2 distance)^(-2 points); both rows leave less than 1e-14.
_QUADRATURE = ((200.0, 3), (16.0, 5))


def polygon_form_factor(points: npt.ArrayLike, normals: npt.ArrayLike, polygons: npt.ArrayLike) -> Float64:
    """Share of the hemisphere over each point that each polygon fills, cosine-weighted, clipped at the horizon.

    points, normals: (p, 3), metres and unit length. polygons: (q, k, 3), convex, plane, 3 to 8 vertices,
    counter-clockwise as seen from the emitting side; repeated vertices are allowed. Returns (p, q) float64 in [0, 1]:
    irradiance over radiosity. Exactly 0 behind the polygon, in its plane and where it is wholly under the horizon.
    Raises InvalidInput for NaN, infinity or other shapes.
    """
    points, normals, polygons = (np.asarray(a, np.float64) for a in (points, normals, polygons))
    _require_valid(points, normals, polygons)
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


def paired_form_factor(points: npt.ArrayLike, normals: npt.ArrayLike, polygons: npt.ArrayLike) -> Float64:
    """(p,) float64: `polygon_form_factor` of point i and polygon i alone; polygons: (p, k, 3)."""
    points, normals, polygons = (np.asarray(a, np.float64) for a in (points, normals, polygons))
    _require_valid(points, normals, polygons)
    if len(points) != len(polygons):
        problem = f"{len(points)} points for {len(polygons)} polygons"
        raise InvalidInput("form factor pairs", problem, "give one polygon per point")
    return _paired(points, normals, polygons)


def _require_valid(points: Float64, normals: Float64, polygons: Float64) -> None:
    for name, array in (("points", points), ("normals", normals), ("polygons", polygons)):
        if not np.isfinite(array).all():
            raise InvalidInput(f"form factor {name}", "not all values are finite", "remove NaN and infinity")
    if points.ndim != 2 or points.shape[-1] != 3 or points.shape != normals.shape:
        problem = f"shapes {points.shape} and {normals.shape}"
        raise InvalidInput("form factor points and normals", problem, "give (p, 3) for both")
    if polygons.ndim != 3 or polygons.shape[2] != 3 or not MIN_VERTICES <= polygons.shape[1] <= MAX_VERTICES:
        remedy = f"give (q, k, 3) with k from {MIN_VERTICES} to {MAX_VERTICES}"
        raise InvalidInput("form factor polygons", f"shape {polygons.shape}", remedy)


def _paired(points: Float64, normals: Float64, polygons: Float64) -> Float64:
    """(m,) form factors of m pairs."""
    spans = polygons - polygons[:, :1]
    area_vectors = 0.5 * np.cross(spans[:, 1:-1], spans[:, 2:]).sum(axis=1)
    offsets = polygons - points[:, None]
    # The height over the plane rounds least from the nearest vertex when the point touches the polygon.
    nearest = np.take_along_axis(offsets, (offsets**2).sum(-1).argmin(-1)[:, None, None], axis=1)[:, 0]
    heights = np.einsum("mkc,mc->mk", offsets, normals)
    remaining = ((nearest * area_vectors).sum(-1) < 0.0) & (heights > 0.0).any(-1)
    centroids = polygons.mean(axis=1)
    radii = np.sqrt(((polygons - centroids[:, None]) ** 2).sum(-1).max(-1))
    distances = np.linalg.norm(centroids - points, axis=-1)
    result = np.zeros(len(points))
    for least_distance, order in _QUADRATURE:
        far = remaining & (distances > least_distance * radii)
        outline, outline_heights = _clipped_outline(offsets[far], heights[far])
        result[far] = _integrated(outline, outline_heights, area_vectors[far], order)
        remaining &= ~far
    result[remaining] = _summed_edges(offsets[remaining], heights[remaining], normals[remaining])
    return np.clip(result, 0.0, 1.0)


def _clipped_ends(offsets: Float64, heights: Float64) -> tuple[Float64, Float64, Float64, Float64]:
    """Start and end (m, k, 3) of the part of each edge above the horizon, and their heights (m, k).

    Edges wholly below get start = end = their own start moved to height 0 where they have one, so no length.
    """
    ends, end_heights = np.roll(offsets, -1, axis=1), np.roll(heights, -1, axis=1)
    span = heights - end_heights
    crossing = (heights > 0.0) != (end_heights > 0.0)
    fraction = np.divide(heights, span, out=np.zeros_like(heights), where=crossing)
    at_horizon = offsets + (ends - offsets) * fraction[..., None]
    starts = np.where((heights > 0.0)[..., None], offsets, at_horizon)
    stops = np.where((end_heights > 0.0)[..., None], ends, at_horizon)
    hidden = (heights <= 0.0) & (end_heights <= 0.0)
    stops = np.where(hidden[..., None], starts, stops)
    return starts, stops, np.maximum(heights, 0.0), np.maximum(end_heights, 0.0)


def _summed_edges(offsets: Float64, heights: Float64, normals: Float64) -> Float64:
    """(m,) form factors of m pairs. offsets: (m, k, 3) from the point to the vertices; heights: (m, k) over it."""
    starts, stops, _, _ = _clipped_ends(offsets, heights)
    cross = np.cross(starts, stops - starts)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, (starts * stops).sum(-1))
    projected = np.einsum("mkc,mc->mk", cross, normals)
    seen = (heights > 0.0) | (np.roll(heights, -1, axis=1) > 0.0)
    # Seen from the emitting side the outline runs against the hand of its cross products, hence the minus.
    total = -np.divide(angle * projected, length, out=np.zeros_like(angle), where=(length > 0.0) & seen).sum(-1)
    # The arc along the horizon bounds the cosine-weighted disk from outside, so it always adds its whole angle.
    leaves = (heights > 0.0) & (np.roll(heights, -1, axis=1) <= 0.0)
    enters = (heights <= 0.0) & (np.roll(heights, -1, axis=1) > 0.0)
    exit_point = np.where(leaves[..., None], stops, 0.0).sum(axis=1)
    entry_point = np.where(enters[..., None], starts, 0.0).sum(axis=1)
    arc_sine = np.linalg.norm(np.cross(exit_point, entry_point - exit_point), axis=-1)
    arc = np.arctan2(arc_sine, (exit_point * entry_point).sum(-1))
    return (total + np.where(leaves.any(-1), arc, 0.0)) / (2.0 * np.pi)


def _clipped_outline(offsets: Float64, heights: Float64) -> tuple[Float64, Float64]:
    """Outline above the horizon as a closed chain of 2 k vertices (m, 2 k, 3), some repeated, and their heights."""
    starts, stops, start_heights, stop_heights = _clipped_ends(offsets, heights)
    next_heights = np.roll(heights, -1, axis=1)
    hidden = (heights <= 0.0) & (next_heights <= 0.0)
    # A convex outline dips below the horizon once: its hidden edges collapse onto the point where it does.
    exit_point = np.where(((heights > 0.0) & (next_heights <= 0.0))[..., None], stops, 0.0).sum(axis=1)[:, None]
    starts, stops = (np.where(hidden[..., None], exit_point, ends) for ends in (starts, stops))
    chain = np.stack([starts, stops], axis=2).reshape(len(offsets), 2 * offsets.shape[1], 3)
    return chain, np.stack([start_heights, stop_heights], axis=2).reshape(chain.shape[:2])


def _integrated(outline: Float64, heights: Float64, area_vectors: Float64, order: int) -> Float64:
    """(m,) form factors by Gauss quadrature over a fan of triangles: cos cos' / (pi d^2) dA."""
    nodes, node_weights = np.polynomial.legendre.leggauss(order)
    nodes, node_weights = 0.5 * (nodes + 1.0), 0.5 * node_weights
    areas = np.linalg.norm(area_vectors, axis=-1)
    unit = area_vectors / np.where(areas > 0.0, areas, 1.0)[:, None]
    # One plane distance for all points of the polygon: its own vertices agree on it only up to rounding.
    plane_distance = np.abs((outline[:, 0] * unit).sum(-1))
    total = np.zeros(len(outline))
    origin, origin_height = outline[:, 0], heights[:, 0]
    for i in range(1, outline.shape[1] - 1):
        side, far_side = outline[:, i] - origin, outline[:, i + 1] - outline[:, i]
        double_area = (np.cross(side, far_side) * unit).sum(-1)
        for u, u_weight in zip(nodes, node_weights, strict=True):
            for v, v_weight in zip(nodes, node_weights, strict=True):
                position = origin + u * (side + v * far_side)
                height = (1.0 - u) * origin_height + u * ((1.0 - v) * heights[:, i] + v * heights[:, i + 1])
                squared = (position * position).sum(-1)
                total += u_weight * v_weight * u * double_area * height / (squared * squared)
    return total * plane_distance / np.pi
