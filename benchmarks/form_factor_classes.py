# SPDX-License-Identifier: GPL-3.0-or-later
"""Adversarial points, normals and triangles for form factors, by class.

Each generator takes a random generator and a count and returns points (n, 3), unit normals (n, 3) and triangles
(n, 3, 3), in metres, as float64 arrays of float32 numbers: the shader and the oracle get the same input. s: radius of
the sphere that a triangle's corners lie on; d: distance to its centre; h: height over its plane.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from vlm_addon.core.scene import Float64

Random = np.random.Generator
Samples = tuple[Float64, Float64, Float64]
Generator = Callable[[Random, int], Samples]

# Small integers whose products, three deep, float32 holds exactly: what is zero on paper is then zero.
_EXACT_STEPS = 32
_DEGENERATE_VALUES = np.array([0.0, 0.0, 1.0, -1.0, 1e-20, -1e-20, 1e18, -1e18])


def _at_distance(nearest: float, farthest: float) -> Generator:
    """Points anywhere around a triangle, half of them with its horizon through it; d/s log-uniform."""

    def generate(random: Random, count: int) -> Samples:
        triangles = _unit(random.normal(size=(count, 3, 3)))
        points = _log_uniform(random, nearest, farthest, (count, 1)) * _unit(random.normal(size=(count, 3)))
        normals = _mixed_normals(random, points, triangles)
        return _single(points), _single(normals), _facing(points, triangles)

    return generate


def _over_the_interior(lowest: float, highest: float) -> Generator:
    """Over the inner part of a well-shaped triangle, h log-uniform; half of the normals straight at it."""

    def generate(random: Random, count: int) -> Samples:
        triangles = _flat_triangles(random, count)
        points = _inner_points(random, triangles)
        points[:, 2] = _log_uniform(random, lowest, highest, count)
        straight = random.random((count, 1)) < 0.5
        normals = np.where(straight, [0.0, 0.0, -1.0], _unit(random.normal(size=(count, 3))))
        return _turned(random, _single(points), _single(normals), _single(triangles))

    return generate


def _near_the_outline(random: Random, count: int) -> Samples:
    """1e-7 to 1e-3 from an edge or a corner, in any direction."""
    triangles = _unit(random.normal(size=(count, 3, 3)))
    offsets = _log_uniform(random, 1e-7, 1e-3, (count, 1)) * _unit(random.normal(size=(count, 3)))
    along = np.where(random.random(count) < 0.5, 0.0, random.random(count))
    points = _on_edge(triangles, along) + offsets
    return _single(points), _single(_unit(random.normal(size=(count, 3)))), _facing(points, triangles)


def _on_the_outline(random: Random, count: int) -> Samples:
    """Exactly on a corner, on an edge, or outside in line with an edge."""
    triangles = _exact_triangles(random, count)
    along = random.choice([0.0, 0.25, 0.5, 0.75, -2.0, -0.5, 1.5, 3.0], count)
    points = _on_edge(triangles, along)
    return points, _single(_unit(random.normal(size=(count, 3)))), _facing(points, triangles)


def _grazing_horizon(random: Random, count: int) -> Samples:
    """One or two corners exactly on the horizon or within 1e-7 s of it; d/s 0.5 to 100."""
    distances = _log_uniform(random, 0.5, 100.0, (count, 1))
    triangles = _unit(random.normal(size=(count, 3, 3)))
    triangles[..., :2] += (distances * _unit(random.normal(size=(count, 2))))[:, None]
    shift = 1e-7 * random.uniform(-1.0, 1.0, (count, 2)) * (random.random((count, 2)) < 0.5)
    triangles[:, 0, 2] = shift[:, 0]
    triangles[:, 1, 2] = np.where(random.random(count) < 0.5, shift[:, 1], triangles[:, 1, 2])
    triangles = np.take_along_axis(triangles, random.permuted(np.tile(np.arange(3), (count, 1)), axis=1)[..., None], 1)
    points, normals = np.zeros((count, 3)), np.tile([0.0, 0.0, 1.0], (count, 1))
    return _turned(random, points, normals, _facing(points, triangles))


def _in_the_plane(random: Random, count: int) -> Samples:
    """Inside the triangle, beside it and on its outline, exactly in its plane."""
    triangles = _exact_triangles(random, count)
    weights = 0.25 * random.integers(-8, 9, (count, 2))
    sides = triangles[:, 1:] - triangles[:, :1]
    points = triangles[:, 0] + (weights[..., None] * sides).sum(axis=1)
    return points, _single(_unit(random.normal(size=(count, 3)))), triangles


def _behind(random: Random, count: int) -> Samples:
    """On the side that emits nothing: half anywhere, half at h 1e-30 to 1 under the interior."""
    half = count // 2
    anywhere = _at_distance(0.5, 1e3)(random, half)
    triangles = anywhere[2][:, ::-1].copy()
    above = _over_the_interior(1e-30, 1.0)(random, count - half)
    below = above[0], above[1], above[2][:, ::-1].copy()
    return _joined((anywhere[0], anywhere[1], triangles), below)


def _under_the_horizon(random: Random, count: int) -> Samples:
    """No corner above the horizon; half of the triangles touch it with a corner or an edge."""
    triangles = _unit(random.normal(size=(count, 3, 3)))
    triangles += (_log_uniform(random, 0.1, 1e3, (count, 1)) * _unit(random.normal(size=(count, 3))))[:, None]
    triangles[..., 2] = -np.abs(triangles[..., 2])
    touching = random.random(count)
    triangles[touching < 0.5, 0, 2] = 0.0
    triangles[touching < 0.25, 1, 2] = 0.0
    points, normals = np.zeros((count, 3)), np.tile([0.0, 0.0, 1.0], (count, 1))
    return _turned(random, points, normals, _facing(points, triangles))


def _slivers(random: Random, count: int) -> Samples:
    """Height over length 1e-7 to 1e-1; d/s 0.3 to 30."""
    triangles = _unit(random.normal(size=(count, 3, 3)))
    height = _log_uniform(random, 1e-7, 1e-1, (count, 1)) * _unit(random.normal(size=(count, 3)))
    triangles[:, 2] = _on_edge(triangles, random.random(count)) + height
    points = _log_uniform(random, 0.3, 30.0, (count, 1)) * _unit(random.normal(size=(count, 3)))
    normals = _mixed_normals(random, points, triangles)
    return _single(points), _single(normals), _facing(points, triangles)


def _without_area(random: Random, count: int) -> Samples:
    """Two or three corners alike, or all on one line."""
    triangles = _exact_triangles(random, count)
    kind = random.integers(0, 3, count)
    triangles[kind < 2, 2] = triangles[kind < 2, 1]
    triangles[kind < 1, 1] = triangles[kind < 1, 0]
    triangles[kind < 1, 2] = triangles[kind < 1, 0]
    in_line = triangles[:, 0] + random.choice([-1.0, 0.5, 2.0], (count, 1)) * (triangles[:, 1] - triangles[:, 0])
    triangles[:, 2] = np.where((kind == 2)[:, None], in_line, triangles[:, 2])
    points = random.integers(-4, 5, (count, 3)).astype(float) * _log_uniform(random, 1e-3, 1e3, (count, 1))
    return _single(points), _single(_unit(random.normal(size=(count, 3)))), triangles


def _sized(size: float) -> Generator:
    """Triangles of one size in metres seen from points some metres off their plane."""

    def generate(random: Random, count: int) -> Samples:
        triangles = _flat_triangles(random, count) * size
        points = np.where(random.random((count, 1)) < 0.5, _inner_points(random, triangles), random.normal(size=3))
        points += random.normal(size=(count, 3)) * [1.0, 1.0, 0.0]
        points[:, 2] = random.uniform(0.1, 10.0, count)
        normals = _mixed_normals(random, points, triangles)
        return _turned(random, _single(points), _single(normals), _single(triangles))

    return generate


def _degenerate(random: Random, count: int) -> Samples:
    """0, +-1, +-1e-20 and +-1e18 in any place; normals of such numbers too."""
    values = random.choice(_DEGENERATE_VALUES, (count, 4, 3))
    normals = np.where(np.abs(values[:, 0]) > 1.0, -1.0, random.choice([0.0, 1.0, -1.0, 1e-20], (count, 3)))
    normals[(normals == 0.0).all(axis=1)] = [0.0, 0.0, 1.0]
    triangles = np.where(random.random((count, 1, 1)) < 0.5, values[:, 1:], random.choice([0.0, 1.0], (count, 3, 3)))
    return _single(values[:, 0]), _single(_unit(normals)), _single(triangles)


def _far_from_the_origin(random: Random, count: int) -> Samples:
    """The class at d/s 1 to 100, moved by 100 to 10,000 m and then rounded."""
    points, normals, triangles = _at_distance(1.0, 100.0)(random, count)
    offsets = _log_uniform(random, 1e2, 1e4, (count, 1)) * _unit(random.normal(size=(count, 3)))
    moved = _single(points + offsets)
    return moved, normals, _facing(moved, triangles + offsets[:, None])


CLASSES: dict[str, Generator] = {
    "d/s 1 to 100": _at_distance(1.0, 100.0),
    "d/s 2 to 4": _at_distance(2.0, 4.0),
    "d/s 300": _at_distance(300.0, 300.0),
    "d/s 100 to 1e6": _at_distance(1e2, 1e6),
    "interior, h 1e-30 to 1": _over_the_interior(1e-30, 1.0),
    "interior, h 1e-6 to 1e-3": _over_the_interior(1e-6, 1e-3),
    "1e-7 to 1e-3 from an edge": _near_the_outline,
    "on a corner or an edge's line": _on_the_outline,
    "grazing the horizon": _grazing_horizon,
    "in the plane": _in_the_plane,
    "behind": _behind,
    "under the horizon": _under_the_horizon,
    "slivers 1e-7 to 1e-1": _slivers,
    "no area": _without_area,
    "huge, 1e4 m": _sized(1e4),
    "tiny, 1e-4 m": _sized(1e-4),
    "0, 1, 1e-20, 1e18 anywhere": _degenerate,
    "moved by 1e2 to 1e4 m": _far_from_the_origin,
}
"""Generators by the name that tables show."""

FAR = ("d/s 300", "d/s 100 to 1e6", "tiny, 1e-4 m")
"""Classes whose bound is a relative one."""

EXACTLY_ZERO = ("on a corner or an edge's line", "in the plane", "behind", "under the horizon", "no area")
"""Classes in which every form factor is exactly 0."""

WITHOUT_ORACLE = ("0, 1, 1e-20, 1e18 anywhere",)
"""Classes in which only finite numbers in [0, 1] are asked for."""


def _single(array: npt.ArrayLike) -> Float64:
    return np.asarray(array, np.float32).astype(np.float64)


def _unit(vectors: Float64) -> Float64:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _log_uniform(random: Random, low: float, high: float, shape: int | tuple[int, ...]) -> Float64:
    return np.exp(random.uniform(np.log(low), np.log(high), shape))


def _facing(points: Float64, triangles: Float64) -> Float64:
    """The triangles, rounded and turned so that the rounded points see their emitting side."""
    points, triangles = _single(points), _single(triangles)
    sides = triangles[:, 1:] - triangles[:, :1]
    in_front = (np.cross(sides[:, 0], sides[:, 1]) * (points - triangles[:, 0])).sum(axis=1) >= 0.0
    return np.where(in_front[:, None, None], triangles, triangles[:, ::-1])


def _mixed_normals(random: Random, points: Float64, triangles: Float64) -> Float64:
    """Half random, half at right angles to the direction to a point of the triangle, so that the horizon cuts it."""
    towards = np.einsum("nk,nkc->nc", random.dirichlet([1.0, 1.0, 1.0], len(points)), triangles) - points
    normals = random.normal(size=points.shape)
    cut = random.random((len(points), 1)) < 0.5
    return _unit(np.where(cut, np.cross(towards, normals), normals))


def _flat_triangles(random: Random, count: int) -> Float64:
    """Triangles of size 1 in the plane z = 0 that emit upwards, no angle under some 30 degrees."""
    angles = (
        np.linspace(0.0, 2.0 * np.pi, 4)[:3] + random.uniform(0.0, 1.0, (count, 3)) + random.random((count, 1)) * 7.0
    )
    return np.stack([np.cos(angles), np.sin(angles), np.zeros((count, 3))], axis=2)


def _inner_points(random: Random, triangles: Float64) -> Float64:
    weights = 0.9 * random.dirichlet([1.0, 1.0, 1.0], len(triangles)) + 0.1 / 3.0
    return np.einsum("nk,nkc->nc", weights, triangles)


def _exact_triangles(random: Random, count: int) -> Float64:
    """Corners on a coarse grid, at scales that are powers of two."""
    scale = 2.0 ** random.integers(-12, 8, (count, 1, 1))
    triangles = random.integers(-_EXACT_STEPS, _EXACT_STEPS + 1, (count, 3, 3)) * scale
    return np.asarray(triangles, np.float64)


def _on_edge(triangles: Float64, along: Float64) -> Float64:
    """(n, 3): the point that share of the way from the first corner to the second."""
    return triangles[:, 0] + along[:, None] * (triangles[:, 1] - triangles[:, 0])


def _turned(random: Random, points: Float64, normals: Float64, triangles: Float64) -> Samples:
    """All samples with their axes cyclically exchanged and mirrored in pairs: exact, and no winding changes."""
    axes = (np.arange(3) + random.integers(0, 3, (len(points), 1))) % 3
    signs = random.choice([-1.0, 1.0], (len(points), 3))
    signs[:, 2] = signs[:, 0] * signs[:, 1]
    points, normals = (np.take_along_axis(a, axes, axis=1) * signs for a in (points, normals))
    return points, normals, np.take_along_axis(triangles, axes[:, None], axis=2) * signs[:, None]


def _joined(first: Samples, second: Samples) -> Samples:
    points, normals, triangles = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    return points, normals, triangles
