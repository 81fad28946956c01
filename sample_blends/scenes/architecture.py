# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of buildings as closed shapes: walls with arches, vaults, mouldings, columns, balusters, cloth. No bpy.

Walls and arches stand in the plane of x and z and go from y = 0 to y = thickness; lengths in metres.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .shapes import Face, Points, Shape, box, grid_faces, join, lathe, moved, shape, turned

WELD_DIGITS = 6


@dataclass(frozen=True)
class Arch:
    """An opening: half its width, the height where the curve starts, and how far the curve rises above that."""

    half_width: float
    springing: float
    rise: float
    segments: int = 16

    def curve(self) -> Points:
        """(segments + 1, 2) points (x, z) from left to right, x from the middle of the opening."""
        angles = math.pi * (1 - np.arange(self.segments + 1) / self.segments)
        sines = np.sin(angles)
        sines[[0, -1]] = 0.0
        return np.c_[self.half_width * np.cos(angles), self.springing + self.rise * sines]


def box_mapped(source: Shape, metres_per_repeat: float) -> Shape:
    """The shape with UVs from the coordinate plane that each face is closest to."""
    uvs = []
    for face in source.faces:
        points = source.vertices[list(face)]
        normal = np.abs(np.cross(points[1] - points[0], points[2] - points[0]))
        kept = ((1, 2), (0, 2), (0, 1))[int(np.argmax(normal))]
        uvs.append(points[:, kept] / metres_per_repeat)
    return replace(source, uvs=np.concatenate(uvs))


def extruded(outlines: npt.ArrayLike, faces: Iterable[Sequence[int]], thickness: float) -> Shape:
    """A flat mesh in the plane of x and z, (n, 2) points, counter-clockwise seen from -y, made thick towards +y."""
    flat = np.asarray(outlines, float)
    n = len(flat)
    fronts = [tuple(face) for face in faces]
    edges = [(face[i], face[(i + 1) % len(face)]) for face in fronts for i in range(len(face))]
    inner = set(edges)
    rims = [(b, a, a + n, b + n) for a, b in edges if (b, a) not in inner]
    backs = [tuple(i + n for i in reversed(face)) for face in fronts]
    vertices = np.concatenate([np.c_[flat[:, 0], np.full(n, y), flat[:, 1]] for y in (0.0, thickness)])
    return shape(vertices, [*fronts, *backs, *rims], smooth=True)


class _Weld:
    """Points in a plane, each kept once."""

    def __init__(self) -> None:
        self.points: dict[tuple[float, float], int] = {}

    def __call__(self, x: float, z: float) -> int:
        key = (round(float(x), WELD_DIGITS), round(float(z), WELD_DIGITS))
        return self.points.setdefault(key, len(self.points))

    def array(self) -> Points:
        return np.array(list(self.points), float)


def arched_wall(bay: float, bays: int, arch: Arch, top: float, thickness: float, foot: float | None = None) -> Shape:
    """A row of bays, each with one arch in its middle, from x = 0.

    Without a foot the wall ends at the springing and needs columns below; with one, its piers go down to that height.
    """
    weld = _Weld()
    faces: list[Face] = []
    curve = arch.curve()
    for index in range(bays):
        middle = (index + 0.5) * bay
        line = [
            (index * bay, arch.springing),
            *((middle + x, z) for x, z in curve),
            ((index + 1) * bay, arch.springing),
        ]
        for (x0, z0), (x1, z1) in itertools.pairwise(line):
            if weld(x0, z0) != weld(x1, z1):
                faces.append((weld(x0, z0), weld(x1, z1), weld(x1, top), weld(x0, top)))
        if foot is not None:
            for (x0, z0), (x1, z1) in (line[:2], line[-2:]):
                faces.append((weld(x0, foot), weld(x1, foot), weld(x1, z1), weld(x0, z0)))
    return extruded(weld.array(), faces, thickness)


def band(section: npt.ArrayLike, length: float) -> Shape:
    """A moulding from x = 0 to x = length with the closed section (k, 2) of (y, z), counter-clockwise seen from +x."""
    outline = np.asarray(section, float)
    k = len(outline)
    vertices = np.concatenate([np.c_[np.full(k, x), outline] for x in (0.0, length)])
    sides = [(i, (i + 1) % k, k + (i + 1) % k, k + i) for i in range(k)]
    return shape(vertices, [tuple(range(k))[::-1], tuple(range(k, 2 * k)), *sides], smooth=True)


def archivolt(section: npt.ArrayLike, arch: Arch) -> Shape:
    """A moulding around an arch. section: closed, (k, 2) of (distance outside the arch, y), such that turning from
    the first axis to the second is counter-clockwise."""
    outline = np.asarray(section, float)
    k, n = len(outline), arch.segments
    angles = math.pi * np.arange(n + 1) / n
    rings = [
        np.c_[
            (arch.half_width + outline[:, 0]) * math.cos(angle),
            outline[:, 1],
            arch.springing + (arch.rise + outline[:, 0]) * math.sin(angle),
        ]
        for angle in angles
    ]
    caps = [tuple(range(k))[::-1], tuple(range(n * k, (n + 1) * k))]
    return shape(np.concatenate(rings), [*grid_faces(k, n, closed=True), *caps], smooth=True)


def groin_vault(length: float, width: float, springing: float, rise: float, top: float, cuts: int) -> Shape:
    """Two barrels that cross, solid up to a flat top, over x in [0, length] and y in [0, width]; cuts is even."""
    steps = (1 - np.cos(math.pi * np.arange(cuts + 1) / cuts)) / 2
    arc = np.sin(math.pi * np.arange(cuts + 1) / cuts)
    arc[[0, -1]] = 0.0
    x, y = np.meshgrid(length * steps, width * steps)
    z = springing + rise * np.maximum(*np.meshgrid(arc, arc))
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    stride, half = cuts + 1, cuts // 2
    faces: list[Face] = []
    for a, b, c, d in grid_faces(cuts, cuts):
        row, column = divmod(a, stride)
        # The edge where the barrels meet runs along the diagonals.
        along = (row < half) == (column < half)
        faces += [(c, b, a), (d, c, a)] if along else [(d, b, a), (d, c, b)]
    ring = [
        *range(cuts),
        *(cuts + stride * i for i in range(cuts)),
        *(stride * stride - 1 - i for i in range(cuts)),
        *(stride * (cuts - i) for i in range(cuts)),
    ]
    n, start = len(ring), len(vertices)
    upper = vertices[ring] * (1, 1, 0) + (0, 0, top)
    middle = (length / 2, width / 2, top)
    for i in range(n):
        j = (i + 1) % n
        faces += [(ring[i], ring[j], start + j, start + i), (start + i, start + j, start + n)]
    return shape(np.concatenate([vertices, upper, [middle]]), faces, smooth=True)


def thick_sheet(points: Points, thickness: float) -> Shape:
    """A closed shell around a grid (rows, columns, 3) of points, thickness/2 to either side."""
    rows, columns = points.shape[:2]
    normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    normals *= thickness / 2 / np.linalg.norm(normals, axis=2, keepdims=True)
    n = rows * columns
    fronts = grid_faces(columns - 1, rows - 1)
    edges = [(face[i], face[(i + 1) % 4]) for face in fronts for i in range(4)]
    inner = set(edges)
    rims = [(b, a, a + n, b + n) for a, b in edges if (b, a) not in inner]
    backs = [tuple(i + n for i in reversed(face)) for face in fronts]
    vertices = np.concatenate([(points + normals).reshape(-1, 3), (points - normals).reshape(-1, 3)])
    return shape(vertices, [*fronts, *backs, *rims], smooth=True)


def tube(outer: tuple[Sequence[float], Sequence[float]], inner: tuple[Sequence[float], Sequence[float]]) -> Shape:
    """A box with a hole through it along z; outer, inner: lower and upper corner, inner's z unused."""
    (x0, y0, z0), (x1, y1, z1) = outer
    (u0, v0), (u1, v1) = inner[0][:2], inner[1][:2]
    rings = [
        [(x, y, z) for x, y in ((a0, b0), (a1, b0), (a1, b1), (a0, b1))]
        for z in (z0, z1)
        for a0, b0, a1, b1 in ((x0, y0, x1, y1), (u0, v0, u1, v1))
    ]
    faces: list[Face] = []
    for i in range(4):
        j = (i + 1) % 4
        faces += [
            (i, j, 8 + j, 8 + i),
            (4 + j, 4 + i, 12 + i, 12 + j),
            (j, i, 4 + i, 4 + j),
            (8 + i, 8 + j, 12 + j, 12 + i),
        ]
    return shape(np.concatenate(rings), faces)


def square(profile: npt.ArrayLike) -> Shape:
    """A profile (k, 2) of (half side, height) from bottom to top with a square plan, flat-faced."""
    corners = np.asarray(profile, float) * (math.sqrt(2), 1)
    return turned(lathe(corners, 4, smooth=False), math.pi / 4)


def capped(profile: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """A profile closed by a disk at its bottom and top."""
    return [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]


def bulge(radius: float, low: float, high: float, depth: float, steps: int) -> list[tuple[float, float]]:
    """Profile points of a half-round moulding (or hollow, with negative depth) between two heights."""
    angles = math.pi * np.arange(1, steps) / steps
    middle, half = (low + high) / 2, (high - low) / 2
    return [(radius + depth * math.sin(a), middle - half * math.cos(a)) for a in angles]


def leaf(height: float, width: float, curl: float, lean: float) -> Shape:
    """An acanthus leaf that stands at the origin, leans to +x by lean and curls outwards at its tip."""
    t = np.linspace(0, 1, 7)[:, None]
    s = np.linspace(-1, 1, 4)[None, :]
    bend = np.clip((t - 0.55) / 0.45, 0, 1) * (0.8 * math.pi)
    x = lean * t + curl * (1 - np.cos(bend)) - 0.06 * width * s**2 * (1 - t)
    z = 0.78 * height * np.clip(t / 0.55, 0, 1) + 0.22 * height * np.sin(bend)
    lobes = (1 - 0.75 * t**3) * (0.85 + 0.15 * np.cos(5 * math.pi * t))
    y = 0.5 * width * s * lobes
    grid = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return thick_sheet(grid, 0.12 * width)


def capital(radius: float, height: float, segments: int) -> Shape:
    """A bell with two rows of leaves under a square slab; it stands on z = 0."""
    abacus = 0.17 * height
    bell_height = height - abacus
    t = np.linspace(0, 1, 7)
    bell = [(radius * (0.92 + 0.42 * u**3), bell_height * float(u)) for u in t]
    parts = [lathe(capped(bell), segments)]
    for row, (start, tall) in enumerate(((0.03, 0.52), (0.28, 0.62))):
        blade = leaf(tall * bell_height, 0.62 * radius, 0.20 * radius, (0.05 + 0.12 * row) * radius)
        stand = moved(blade, (0.94 * radius, 0.0, start * bell_height))
        parts += [turned(stand, 2 * math.pi * (i + row / 2) / 8) for i in range(8)]
    half = 1.36 * radius
    parts.append(
        moved(square(capped([(half, 0), (half * 1.04, 0.5 * abacus), (half * 1.08, abacus)])), (0, 0, bell_height))
    )
    return join(parts)


def column(radius: float, height: float, segments: int = 24) -> Shape:
    """A round column with base and capital, radius taken at the foot of its shaft; it stands on z = 0."""
    plinth, base, crown = 0.30 * radius, 0.85 * radius, 2.1 * radius
    low, high = base, height - crown
    shaft = [(radius * (1 - 0.16 * float(u) ** 1.8), low + (high - low) * float(u)) for u in np.linspace(0, 1, 7)]
    neck = shaft[-1][0]
    turned_part = [
        (1.12 * radius, plinth),
        *bulge(1.16 * radius, plinth, plinth + 0.28 * radius, 0.20 * radius, 6),
        *bulge(1.16 * radius, plinth + 0.28 * radius, plinth + 0.40 * radius, -0.08 * radius, 4),
        *bulge(1.06 * radius, plinth + 0.40 * radius, base, 0.12 * radius, 5),
        *shaft,
        *bulge(neck, high, high + 0.12 * radius, 0.10 * radius, 5),
    ]
    foot = square(capped([(1.38 * radius, 0.0), (1.38 * radius, plinth)]))
    top = moved(capital(neck, crown - 0.12 * radius, segments), (0, 0, high + 0.12 * radius))
    return join([foot, lathe(capped([*turned_part, (neck * 0.9, high + 0.12 * radius)]), segments), top])


BALUSTER = (
    (0.62, 0.00), (0.62, 0.07), (0.42, 0.10), (0.40, 0.14), (0.62, 0.24), (0.88, 0.34), (0.86, 0.42), (0.60, 0.56),
    (0.38, 0.70), (0.34, 0.80), (0.50, 0.84), (0.40, 0.88), (0.62, 0.93), (0.62, 1.00),
)  # fmt: skip


def baluster(height: float, radius: float, segments: int = 12) -> Shape:
    """A turned post of a balustrade; radius is that of its belly."""
    return lathe(capped([(r * radius / 0.88, z * height) for r, z in BALUSTER]), segments)


def pedestal(half_side: float, height: float) -> Shape:
    """A square block with projecting foot and cap."""
    wide = half_side * 1.12
    steps = [
        (wide, 0.0), (wide, 0.12), (half_side, 0.17), (half_side, 0.83), (wide, 0.88), (wide * 1.03, 0.94), (wide, 1.0),
    ]  # fmt: skip
    return square(capped([(half, z * height) for half, z in steps]))


def drawn_curtain(width: float, height: float, gathered: float, folds: int, cells: tuple[int, int]) -> Shape:
    """A curtain hanging from z = 0 over x in [0, width], tied to its left side a little below the middle."""
    columns, rows = cells
    u = np.linspace(0, 1, columns + 1)[None, :]
    v = np.linspace(0, 1, rows + 1)[:, None]
    tie = 0.62
    above = np.clip(v / tie, 0, 1)
    below = np.clip((v - tie) / (1 - tie), 0, 1)
    # Below the tie the cloth opens again, with the same width and slope where the two meet.
    span = width - (width - gathered) * (above**1.7 - 0.3 * below**2)
    droop = 0.10 * height * u * np.sin(math.pi * above)
    # Folds stay wider than the cloth is thick, or its two sides would pass through each other.
    amplitude = 0.035 + 0.02 * (1 - span / width) + 0.015 * below
    wave = np.sin(2 * math.pi * folds * u + 0.6 * np.sin(5 * v + 3 * u))
    x, y, z = u * span, amplitude * wave, -v * height - droop
    return thick_sheet(np.stack(np.broadcast_arrays(x, y, z), axis=-1), 0.012)


def swag(width: float, drop: float, cells: tuple[int, int]) -> Shape:
    """A cloth hanging in a bow from z = 0 between x = 0 and x = width, its lower edge drop below its ends."""
    columns, rows = cells
    u = np.linspace(0, 1, columns + 1)[None, :]
    v = np.linspace(0, 1, rows + 1)[:, None]
    bow = 4 * u * (1 - u)
    z = -(0.12 + 0.88 * bow) * drop * v - 0.04 * drop * bow
    y = 0.05 * bow * np.sin(2 * math.pi * 3.5 * v) * (0.3 + 0.7 * v) + 0.06 * bow
    return thick_sheet(np.stack(np.broadcast_arrays(u * width, y, z), axis=-1), 0.02)


def rod(length: float, radius: float, segments: int = 10) -> Shape:
    """A round bar from x = 0 to x = length."""
    return turned(lathe(capped([(radius, 0.0), (radius, length)]), segments), math.pi / 2, "y")


def door(width: float, height: float, thickness: float) -> Shape:
    """A double door of framed panels; its front is at y = 0, panels lie behind, its foot on z = 0."""
    leaf_width, frame = width / 2, 0.11 * width / 2
    parts = [box((0, 0.35 * thickness, 0), (width, thickness, height))]
    for start in (0.0, leaf_width):
        xs = (start + 0.002, start + frame, start + leaf_width - frame, start + leaf_width - 0.002)
        parts += [
            box((xs[0], 0, 0), (xs[1], thickness / 2, height)),
            box((xs[2], 0, 0), (xs[3], thickness / 2, height)),
        ]
        for low in (0.0, 0.36, 0.66, 0.955):
            z = low * height
            parts.append(box((xs[1], 0.04 * thickness, z), (xs[2], thickness / 2, z + 0.045 * height)))
    return join(parts)
