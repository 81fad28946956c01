# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles in voxel coordinates for tests of octrees, and oracles that do not use one."""

from __future__ import annotations

import numpy as np


def soup(count, depth, rng):
    """(count, 3, 3) triangles of every size in the cube of 2^depth voxels: slivers, points, and corners on faces."""
    size = float(1 << depth)
    middle = rng.uniform(0.0, size, (count, 1, 3))
    corners = middle + rng.normal(size=(count, 3, 3)) * size * 2.0 ** rng.uniform(-12.0, 0.0, (count, 1, 1))
    corners[::5, 2] = corners[::5, 1] + (corners[::5, 0] - corners[::5, 1]) * rng.uniform(0.0, 1.0, (1, 1))
    corners[1::5] = np.round(corners[1::5])
    corners[2::15] = corners[2::15, :1]
    corners[3::7, :, 2] = corners[3::7, :1, 2]
    return np.clip(corners, 0.0, size)


def sphere(depth, rings=24, radius=0.42, centre=(0.5, 0.47, 0.53)):
    """A closed, convex ball of (t, 3, 3) triangles that face outwards; radius and centre in shares of the cube."""
    polar = np.linspace(0.0, np.pi, rings + 1)
    around = np.linspace(0.0, 2.0 * np.pi, 2 * rings, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around)], axis=1)
    grid = np.concatenate(
        [
            np.sin(polar)[:, None, None] * ring[None],
            np.broadcast_to(np.cos(polar)[:, None, None], (rings + 1, 2 * rings, 1)),
        ],
        axis=2,
    )
    grid[0, :], grid[-1, :] = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
    return closed_grid(grid[:, :, :]) * radius * (1 << depth) + np.array(centre) * (1 << depth)


def torus(depth, sides=(48, 24), radii=(0.3, 0.12)):
    """A closed ring of (t, 3, 3) triangles, tilted; radii in shares of the cube."""
    long, short = (np.linspace(0.0, 2.0 * np.pi, count + 1) for count in sides)
    out = radii[0] + radii[1] * np.cos(short)[None, :]
    up = np.broadcast_to(radii[1] * np.sin(short)[None, :], (len(long), len(short)))
    grid = np.stack([out * np.cos(long)[:, None], out * np.sin(long)[:, None], up], axis=2)
    grid[-1], grid[:, -1] = grid[0], grid[:, 0]
    axis_1, axis_2 = np.array([0.8, 0.6, 0.0]), np.array([-0.36, 0.48, 0.8])
    turn = np.stack([axis_1, axis_2, np.cross(axis_1, axis_2)])
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    return split(quads) @ turn * (1 << depth) + 0.5 * (1 << depth)


def closed_grid(grid):
    """Triangles of a grid of points whose columns close; rows that are one point give triangles without area."""
    following = np.roll(grid, -1, axis=1)
    quads = np.stack([grid[:-1], grid[1:], following[1:], following[:-1]], axis=2).reshape(-1, 4, 3)
    return split(quads)


def split(quads):
    """(2 q, 3, 3) triangles with area of (q, 4, 3) quads."""
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    return triangles[area > 0.0]


def box(low, high):
    """The 12 triangles of a box, facing outwards."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side, order in ((low, ((0, 0), (0, 1), (1, 1), (1, 0))), (high, ((0, 0), (1, 0), (1, 1), (0, 1)))):
            quad = np.empty((4, 3))
            for row, (a, b) in enumerate(order):
                quad[row, axis] = side[axis]
                quad[row, u], quad[row, v] = (low, high)[a][u], (low, high)[b][v]
            quads.append(quad)
    return split(np.array(quads))


def meets_any_box(starts, ends, lows, highs):
    """(n,) whether segments and any of (b, 3) closed boxes have a point in common: slabs, every pair."""
    found = np.zeros(len(starts), bool)
    for first in range(0, len(starts), 256):
        part = slice(first, first + 256)
        start, along = starts[part, None], (ends - starts)[part, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (lows - start) / along, (highs - start) / along
        inside = (start >= lows) & (start <= highs)
        enter = np.where(along == 0.0, np.where(inside, -np.inf, np.inf), np.minimum(a, b))
        leave = np.where(along == 0.0, np.where(inside, np.inf, -np.inf), np.maximum(a, b))
        enter, leave = np.maximum(enter.max(axis=2), 0.0), np.minimum(leave.min(axis=2), 1.0)
        found[part] = (enter <= leave).any(axis=1)
    return found


def convex_crossing(starts, ends, triangles):
    """(n,) whether segments meet the surface of a convex solid: exact but for float64, by cutting with its planes."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    offsets = np.einsum("ij,ij->i", normals, triangles[:, 0])
    enter, leave = np.zeros(len(starts)), np.ones(len(starts))
    inside_at_start, inside_at_end = np.ones(len(starts), bool), np.ones(len(starts), bool)
    for normal, offset in zip(normals, offsets, strict=True):
        a, b = starts @ normal - offset, ends @ normal - offset
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a / (a - b)
        enter = np.where((a > 0.0) & (b <= 0.0), np.maximum(enter, at), enter)
        leave = np.where((a <= 0.0) & (b > 0.0), np.minimum(leave, at), leave)
        leave = np.where((a > 0.0) & (b > 0.0), -1.0, leave)
        inside_at_start &= a < 0.0
        inside_at_end &= b < 0.0
    return (enter <= leave) & ~(inside_at_start & inside_at_end)


def crossings(starts, ends, triangles):
    """(n,) fraction of each segment at which it first meets any of (t, 3, 3) triangles, inf if none, and the triangle:
    float64, every pair (Moeller and Trumbore 1997)."""
    fractions, first = np.full(len(starts), np.inf), np.zeros(len(starts), int)
    a, ab, ac = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    at_once = max(1, 2_000_000 // max(len(triangles), 1))
    for begin in range(0, len(starts), at_once):
        part = slice(begin, begin + at_once)
        along = (ends - starts)[part, None].astype(float)
        offset = starts[part, None].astype(float) - a
        across = np.cross(along, ac)
        turned = np.cross(offset, ab)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / (across * ab).sum(axis=2)
            u, v = (across * offset).sum(axis=2) * scale, (turned * along).sum(axis=2) * scale
            at = (turned * ac).sum(axis=2) * scale
            meets = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (at >= 0.0) & (at <= 1.0)
        at = np.where(meets, at, np.inf)
        first[part] = at.argmin(axis=1)
        fractions[part] = at.min(axis=1)
    return fractions, first


def surface_points(triangles, count, rng):
    """(n, 3) points spread evenly over (t, 3, 3) triangles, and their unit normals."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(across, axis=1)
    rows = rng.choice(len(triangles), count, p=area / area.sum())
    u, v = rng.uniform(size=(2, count, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = (triangles[rows, corner] for corner in range(3))
    return a + u * (b - a) + v * (c - a), across[rows] / area[rows, None]
