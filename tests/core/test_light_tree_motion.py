# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing pops when a lamp moves, which moves the windows, or a mesh turns, which cuts its clusters anew.

From frame to frame the irradiance at fixed points changes as the full sum does, to within the tolerance.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import room
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_mesh import VirtualLightMesh, join
from vlm_addon.core.light_tree import LightTree, build_light_tree
from vlm_addon.core.light_tree_error import full_irradiance
from vlm_addon.core.metrics import POINT_ERROR_FLOOR
from vlm_addon.core.scene import Float64

TURN = 0.9


def walls() -> VirtualLightMesh:
    return lights_from_triangles(0.5 + 1.02 * (room(12) - 0.5))


def points_on_walls(count: int) -> tuple[Float64, Float64]:
    random = np.random.default_rng(2)
    points, normals = random.uniform(0.0, 1.0, (count, 3)), np.zeros((count, 3))
    axis, side = random.integers(0, 3, count), random.integers(0, 2, count)
    points[np.arange(count), axis] = side
    normals[np.arange(count), axis] = 1 - 2 * side
    return points, normals


def lit_by(lights: VirtualLightMesh, lamp: Float64) -> Float64:
    """(n, 3) of a lamp in the room, brightest on the walls next to it."""
    away = lamp - lights.corners.mean(axis=1)
    squared = (away * away).sum(axis=1)
    cosine = np.maximum((away * lights.area_vectors).sum(axis=1) / (lights.areas * np.sqrt(squared)), 0.0)
    return (cosine / squared)[:, None] * [0.3, 0.2, 0.1]


def largest_pop(found: Float64, full: Float64) -> float:
    """Of (frames, points): largest change from frame to frame that the full sum does not make, as a share of it."""
    reference = np.maximum(full, POINT_ERROR_FLOOR * full.mean(axis=1, keepdims=True))[1:]
    return float((np.abs(np.diff(found - full, axis=0)) / reference).max())


def values(
    lights: VirtualLightMesh, trees: list[LightTree], radiosity: Float64, tolerance: float, at: tuple[Float64, Float64]
) -> tuple[Float64, Float64]:
    """(p,) of the trees together and of the full sum."""
    tags = np.zeros(len(at[0]), np.int32)
    found = np.zeros(len(at[0]))
    for tree in trees:
        clusters = light_clusters(tree, lights, radiosity, tolerance)
        found += cut_irradiance(tree, clusters, lights, radiosity, *at, tags).irradiance.sum(axis=1)
    return found, full_irradiance(lights, radiosity, *at, tags).sum(axis=1)


def moving_lamp(frames: int, tolerance: float) -> float:
    """1,000 frames take the lamp once round the room; fewer, a part of the way at the same speed."""
    lights = walls()
    trees, at, pairs = [build_light_tree(lights)], points_on_walls(30), []
    for frame in range(frames):
        angle = 2.0 * np.pi * frame / 1000
        lamp = np.array([0.5 + 0.35 * np.cos(angle), 0.5 + 0.35 * np.sin(angle), 0.5 + 0.3 * np.sin(3.0 * angle)])
        pairs.append(values(lights, trees, lit_by(lights, lamp), tolerance, at))
    return largest_pop(*np.stack(pairs, axis=1))


def turning_mesh(frames: int, tolerance: float) -> float:
    """A cube of 1,728 lights turns in the middle of the room, by TURN degrees a frame; its tree is made anew."""
    static, at, pairs = walls(), points_on_walls(30), []
    still = build_light_tree(join([static, static]), np.arange(2 * len(static)) < len(static))
    outwards = 0.4 + 0.2 * room(12)[:, ::-1]
    for frame in range(frames):
        angle = np.radians(TURN * frame)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        cube = lights_from_triangles(0.5 + (outwards - 0.5) @ turn.T)
        lights = join([static, cube])
        # Each face of the cube has a brightness of its own, which turns with it.
        bright = 1.0 + np.arange(len(cube)) // (len(cube) // 6)
        radiosity = np.concatenate([np.full(len(static), 0.2), bright])[:, None] * np.ones(3)
        moved = build_light_tree(lights, np.arange(len(lights)) >= len(static))
        pairs.append(values(lights, [still, moved], radiosity, tolerance, at))
    return largest_pop(*np.stack(pairs, axis=1))


@pytest.mark.parametrize("scene", [moving_lamp, turning_mesh])
def test_some_frames_without_popping(scene: object) -> None:
    assert scene(12, 0.02) <= 0.02  # type: ignore[operator]


@pytest.mark.full
@pytest.mark.parametrize("scene", [moving_lamp, turning_mesh])
@pytest.mark.parametrize("tolerance", [0.02, 0.1])
def test_a_thousand_frames_without_popping(scene: object, tolerance: float) -> None:
    pop = scene(1000, tolerance)  # type: ignore[operator]
    print(f"{scene.__name__} at {tolerance:g}: largest pop {pop:.4f}")  # type: ignore[attr-defined]
    assert pop <= tolerance
