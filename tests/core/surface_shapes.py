# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed-form surfaces for the tests of the authoring functions."""

from __future__ import annotations

import numpy as np

from vlm_addon.core.scene import Mesh


def mesh_of(
    positions: np.ndarray,
    triangles: np.ndarray,
    *,
    name: str = "shape",
    reflectance: object = 0.5,
    emission: object = 0.0,
    materials: object = 0,
    tags: object = 0,
    dynamic: bool = False,
) -> Mesh:
    """A Mesh with the given surface; per-triangle values may be given once for all."""
    count = len(triangles)

    def rows(value: object, width: int, dtype: type) -> np.ndarray:
        shape = (count, width) if width else (count,)
        return np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype), shape))

    return Mesh(
        name=name,
        positions=np.asarray(positions, np.float64).reshape(-1, 3),
        triangles=np.asarray(triangles, np.int32).reshape(-1, 3),
        corner_normals=np.zeros((count, 3, 3), np.float32),
        corner_uvs=np.zeros((count, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=rows(materials, 0, np.int32),
        tag_ids=rows(tags, 0, np.int32),
        reflectance=rows(reflectance, 3, np.float32),
        emission=rows(emission, 3, np.float32),
        dynamic=dynamic,
    )


def grid(columns: int, rows: int, width: float = 1.0, height: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """An open flat grid in the plane z = 0 facing +z."""
    x, y = np.meshgrid(np.linspace(0.0, width, columns + 1), np.linspace(0.0, height, rows + 1), indexing="ij")
    positions = np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3)
    index = np.arange(len(positions)).reshape(columns + 1, rows + 1)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    return positions, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def sheet(function: object, columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """The grid over the unit square with z = function(x, y)."""
    positions, triangles = grid(columns, rows)
    positions[:, 2] = function(positions[:, 0], positions[:, 1])  # type: ignore[operator]
    return positions, triangles


def cube(cells: int = 1, size: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(positions, triangles, side 0 to 5 of each triangle) of a cube, outward, with vertices split between sides."""
    flat, triangles = grid(cells, cells)
    flat = flat - [0.5, 0.5, -0.5]
    turns = [
        np.array(rows, float)
        for rows in (
            [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
            [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
            [[0, 0, -1], [-1, 0, 0], [0, 1, 0]],
            [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
            [[0, -1, 0], [0, 0, -1], [1, 0, 0]],
        )
    ]
    positions = np.concatenate([flat @ turn.T for turn in turns]) * size
    faces = np.concatenate([triangles + side * len(flat) for side in range(6)])
    return positions, faces, np.repeat(np.arange(6), len(triangles))


def icosphere(subdivisions: int, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed sphere of 20 * 4^subdivisions triangles with shared vertices, outward."""
    golden = (1 + 5**0.5) / 2
    positions = [[-1, golden, 0], [1, golden, 0], [-1, -golden, 0], [1, -golden, 0], [0, -1, golden], [0, 1, golden]]
    positions += [[0, -1, -golden], [0, 1, -golden], [golden, 0, -1], [golden, 0, 1], [-golden, 0, -1], [-golden, 0, 1]]
    faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6]]
    faces += [[7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10]]
    faces += [[8, 6, 7], [9, 8, 1]]
    points, triangles = np.array(positions, float), np.array(faces)
    for _ in range(subdivisions):
        points, triangles = _halved(points, triangles)
    return points / np.linalg.norm(points, axis=1, keepdims=True) * radius, triangles


def _halved(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    points = points / np.linalg.norm(points, axis=1, keepdims=True)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = (inverse.ravel() + len(points)).reshape(3, -1)
    a, b, c = triangles.T
    ab, bc, ca = middle
    faces = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([points, points[unique].mean(axis=1)]), np.concatenate(faces)


def split_vertices(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same surface with three vertices of its own for every triangle."""
    return positions[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)


def open_edges(vertices: np.ndarray, triangles: np.ndarray) -> int:
    """Edges, by position, that do not have exactly two triangles of opposite direction: 0 for closed surfaces."""
    _, welded = np.unique(vertices, axis=0, return_inverse=True)
    directed: dict[tuple[int, int], int] = {}
    for triangle in welded.ravel()[triangles]:
        for start, end in zip(triangle, np.roll(triangle, -1), strict=True):
            directed[(int(start), int(end))] = directed.get((int(start), int(end)), 0) + 1
    return sum(1 for (start, end), count in directed.items() if count != 1 or directed.get((end, start), 0) != 1)


def areas_of(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(t,) area of each triangle."""
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
