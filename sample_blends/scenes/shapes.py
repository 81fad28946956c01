# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of the sample scenes: pure functions from numbers to polygons. No bpy.

Lengths in metres, z up. Polygons run counter-clockwise as seen from the front.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]
Face = tuple[int, ...]


@dataclass(frozen=True)
class Shape:
    """Polygons over shared vertices.

    vertices: (v, 3) float64. faces: vertex indices of each polygon. materials: slot of each face. uvs: (corners, 2)
    float64 in face order, or None where no texture is meant.
    """

    vertices: Points
    faces: tuple[Face, ...]
    materials: tuple[int, ...]
    uvs: Points | None = None
    smooth: bool = False

    @property
    def triangle_count(self) -> int:
        """Number of triangles that the polygons fall into."""
        return sum(len(face) - 2 for face in self.faces)


def shape(vertices: npt.ArrayLike, faces: Iterable[Sequence[int]], material: int = 0, smooth: bool = False) -> Shape:
    """A shape whose faces all use one material slot."""
    tuples = tuple(tuple(int(index) for index in face) for face in faces)
    return Shape(np.asarray(vertices, float).reshape(-1, 3), tuples, (material,) * len(tuples), None, smooth)


def with_material(source: Shape, material: int) -> Shape:
    """The same shape with every face in one material slot."""
    return replace(source, materials=(material,) * len(source.faces))


def join(parts: Sequence[Shape]) -> Shape:
    """All parts as one shape; vertices are not welded. UVs of parts without any become zero where others have some."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [
        tuple(i + int(start) for i in face) for part, start in zip(parts, starts, strict=False) for face in part.faces
    ]
    uvs = None
    if any(part.uvs is not None for part in parts):
        corners = [sum(len(face) for face in part.faces) for part in parts]
        uvs = np.concatenate(
            [np.zeros((n, 2)) if part.uvs is None else part.uvs for part, n in zip(parts, corners, strict=True)]
        )
    return Shape(
        np.concatenate([part.vertices for part in parts]),
        tuple(faces),
        tuple(slot for part in parts for slot in part.materials),
        uvs,
        any(part.smooth for part in parts),
    )


def moved(source: Shape, offset: Sequence[float]) -> Shape:
    """The shape shifted by offset (m)."""
    return replace(source, vertices=source.vertices + np.asarray(offset, float))


def scaled(source: Shape, factors: Sequence[float] | float) -> Shape:
    """The shape scaled about the origin by positive factors."""
    return replace(source, vertices=source.vertices * np.asarray(factors, float))


def turned(source: Shape, angle: float, axis: str = "z") -> Shape:
    """The shape rotated about a coordinate axis by angle (radians, counter-clockwise seen from the axis's tip)."""
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    vertices = source.vertices.copy()
    a, b = source.vertices[:, first], source.vertices[:, second]
    vertices[:, first] = math.cos(angle) * a - math.sin(angle) * b
    vertices[:, second] = math.sin(angle) * a + math.cos(angle) * b
    return replace(source, vertices=vertices)


def flipped(source: Shape) -> Shape:
    """The shape with every face turned to its other side."""
    uvs = source.uvs
    if uvs is not None:
        ends = np.cumsum([len(face) for face in source.faces])[:-1]
        uvs = np.concatenate([part[::-1] for part in np.split(uvs, ends)])
    return replace(source, faces=tuple(face[::-1] for face in source.faces), uvs=uvs)


def patch(
    corner: Sequence[float], along: Sequence[float], across: Sequence[float], columns: int = 1, rows: int = 1
) -> Shape:
    """A parallelogram of columns x rows quads with UVs from 0 to 1; its front is the side of along x across."""
    s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    st = np.stack([s.ravel(), t.ravel()], axis=1)
    vertices = np.asarray(corner, float) + st @ np.stack([along, across]).astype(float)
    faces = grid_faces(columns, rows)
    uvs = np.concatenate([st[list(face)] for face in faces])
    return replace(shape(vertices, faces), uvs=uvs)


def room_walls(size: Sequence[float], left_name: str, right_name: str) -> dict[str, Shape]:
    """The six walls of a room (across, deep, high), facing inwards; the floor is at z = 0, its near edge at y = 0 and
    its middle at x = 0."""
    width, depth, height = size
    left, right = -width / 2, width / 2
    x, y, z = (width, 0, 0), (0, depth, 0), (0, 0, height)
    return {
        "Floor": patch((left, 0, 0), x, y),
        "Ceiling": patch((left, 0, height), y, x),
        "Far wall": patch((left, depth, 0), x, z),
        "Near wall": patch((left, 0, 0), z, x),
        left_name: patch((left, 0, 0), y, z),
        right_name: patch((right, 0, 0), z, y),
    }


def grid_faces(columns: int, rows: int, closed: bool = False) -> list[Face]:
    """Quads over a row-major grid of points; closed: each row is a ring of `columns` points, else columns + 1."""
    stride = columns if closed else columns + 1
    return [
        (r * stride + c, r * stride + (c + 1) % stride, (r + 1) * stride + (c + 1) % stride, (r + 1) * stride + c)
        for r in range(rows)
        for c in range(columns)
    ]


BOX_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def box(lower: Sequence[float], upper: Sequence[float]) -> Shape:
    """An axis-aligned box seen from outside; faces in the order -z, +z, -y, +y, -x, +x."""
    ends = np.stack([lower, upper]).astype(float)
    corners = [(ends[i & 1, 0], ends[i >> 1 & 1, 1], ends[i >> 2, 2]) for i in range(8)]
    return shape(corners, BOX_FACES)


def prism(outline: npt.ArrayLike, bottom: float, top: float) -> Shape:
    """A closed upright prism over an outline (k, 2), counter-clockwise from above; faces: bottom, top, then sides."""
    ring = np.asarray(outline, float)
    k = len(ring)
    vertices = np.concatenate([np.c_[ring, np.full(k, bottom)], np.c_[ring, np.full(k, top)]])
    sides = [(i, (i + 1) % k, k + (i + 1) % k, k + i) for i in range(k)]
    return shape(vertices, [tuple(range(k))[::-1], tuple(range(k, 2 * k)), *sides])


OCTAHEDRON = (
    ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)),
    ((0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)),
)


def octahedron(radius: float) -> Shape:
    """The regular octahedron of 8 triangles with its corners on a sphere."""
    vertices, faces = OCTAHEDRON
    return shape(np.array(vertices, float) * radius, faces)


def icosphere(radius: float, subdivisions: int, smooth: bool = True) -> Shape:
    """A sphere of 20 x 4^subdivisions triangles, every vertex on the sphere."""
    golden = (1 + math.sqrt(5)) / 2
    pairs = [(-1, golden), (1, golden), (-1, -golden), (1, -golden)]
    corners = [(a, b, 0.0) for a, b in pairs] + [(0.0, a, b) for a, b in pairs] + [(b, 0.0, a) for a, b in pairs]
    vertices = [np.array(corner) / math.hypot(1, golden) for corner in corners]
    faces: list[Face] = [
        (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
        (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7),
        (9, 8, 1),
    ]  # fmt: skip
    for _ in range(subdivisions):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, known: dict[tuple[int, int], int] = middles) -> int:
            key = (min(a, b), max(a, b))
            if key not in known:
                between = vertices[a] + vertices[b]
                known[key] = len(vertices)
                vertices.append(between / np.linalg.norm(between))
            return known[key]

        split: list[Face] = []
        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = split
    return shape(np.array(vertices) * radius, faces, smooth=smooth)


def lathe(profile: npt.ArrayLike, segments: int, smooth: bool = True) -> Shape:
    """A profile (k, 2) of (radius, height), from bottom to top, turned about z; faces look outwards.

    A point of radius 0 becomes a pole with triangles.
    """
    points = np.asarray(profile, float)
    angles = np.arange(segments) * (2 * math.pi / segments)
    vertices: list[Points] = []
    rings: list[list[int]] = []
    for radius, height in points:
        count = 1 if radius == 0 else segments
        start = sum(len(ring) for ring in rings)
        rings.append([start + i % count for i in range(segments)] if count > 1 else [start])
        ring_angles = angles[:count]
        vertices.append(np.c_[radius * np.cos(ring_angles), radius * np.sin(ring_angles), np.full(count, height)])
    faces: list[Face] = []
    for below, above in itertools.pairwise(rings):
        for i in range(segments):
            j = (i + 1) % segments
            if len(below) == 1 and len(above) == 1:
                continue
            if len(below) == 1:
                faces.append((below[0], above[j], above[i]))
            elif len(above) == 1:
                faces.append((below[i], below[j], above[0]))
            else:
                faces.append((below[i], below[j], above[j], above[i]))
    return shape(np.concatenate(vertices), faces, smooth=smooth)


def triangles_of(source: Shape) -> npt.NDArray[np.int64]:
    """(t, 3) vertex indices: every polygon as a fan from its first corner, in face order."""
    fans = [(face[0], face[i], face[i + 1]) for face in source.faces for i in range(1, len(face) - 1)]
    return np.array(fans, np.int64).reshape(-1, 3)


def area_m2(source: Shape) -> float:
    """Area of all faces, m²."""
    a, b, c = np.moveaxis(source.vertices[triangles_of(source)], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
