# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed rooms without anything in them, whose light has closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.render.rooms import camera_at, quad
from vlm_addon.core.scene import DIFFUSE, Float64, Light, Material, Mesh, SceneSnapshot

ROOM_SIZE = (4.0, 3.0, 2.5)
"""Of the sample scene empty_room, m; its middle is the origin."""
ROOM_REFLECTANCES = (
    (0.65, 0.32, 0.30),
    (0.32, 0.55, 0.35),
    (0.60, 0.58, 0.52),
    (0.50, 0.55, 0.62),
    (0.45, 0.38, 0.30),
    (0.70, 0.70, 0.70),
)
"""Of its walls at -x, +x, -y, +y, -z, +z."""


def inward_box(
    low: Sequence[float], high: Sequence[float], materials: Sequence[int], outward: bool = False
) -> list[Mesh]:
    """Walls at -x, +x, -y, +y, -z, +z that face the middle, or away from it."""
    low_corner, size = np.asarray(low, float), np.asarray(high, float) - np.asarray(low, float)
    walls = []
    for axis in range(3):
        for at_high in (False, True):
            corner, u, v = low_corner.copy(), np.zeros(3), np.zeros(3)
            corner[axis] += size[axis] * at_high
            first, second = (axis + 1) % 3, (axis + 2) % 3
            u[first], v[second] = size[first], size[second]
            faces_along_axis = at_high == outward
            pair = (u, v) if faces_along_axis else (v, u)
            walls.append(quad(corner, *pair, material=materials[2 * axis + at_high], name=f"wall {axis} {at_high}"))
    return walls


def empty_room(lights: Sequence[Light], reflectances: Sequence[Sequence[float]] = ROOM_REFLECTANCES) -> SceneSnapshot:
    """The sample scene empty_room with other lamps; with one reflectance it is that of all walls."""
    colors = tuple(reflectances) * (6 // len(reflectances))
    materials = tuple(Material(f"wall {i}", DIFFUSE, tuple(color)) for i, color in enumerate(colors))  # type: ignore[arg-type]
    half = 0.5 * np.array(ROOM_SIZE)
    camera = camera_at((-1.8, -1.0, 0.55), (0.55, 0.45, -0.18), lens=17.0)
    meshes = tuple(inward_box(-half, half, range(6)))
    return SceneSnapshot("empty room", meshes, materials, lights=tuple(lights), camera=camera)


def wall_points(count: int, seed: int = 0, margin: float = 0.0) -> tuple[Float64, Float64, Float64]:
    """Random points of the walls by area: positions, inward normals, (count, 3) float64 each, and the wall's index."""
    random = np.random.default_rng(seed)
    size = np.array(ROOM_SIZE)
    areas = np.repeat([size[1] * size[2], size[2] * size[0], size[0] * size[1]], 2)
    wall = random.choice(6, count, p=areas / areas.sum())
    positions = (random.random((count, 3)) - 0.5) * (size - 2.0 * margin)
    axis, sign = wall // 2, 2.0 * (wall % 2) - 1.0
    normals = np.zeros((count, 3))
    positions[np.arange(count), axis] = 0.5 * sign * size[axis]
    normals[np.arange(count), axis] = -sign
    return positions, normals, wall


def room_area() -> float:
    """m²."""
    x, y, z = ROOM_SIZE
    return 2.0 * (x * y + y * z + z * x)
