# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes in which nothing can stand between two surfaces are told from those in which something may."""

from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import inward_box
from tests.render.rooms import box_room, quad
from vlm_addon.core import occluders
from vlm_addon.core.occluders import find_occlusion

ROOM = inward_box([-1, -1, -1], [1, 1, 1], [0] * 6)


def turned(meshes):
    """Turned about an axis and rounded to float32 as Blender's vertices are."""
    axis = np.array([0.36, 0.48, 0.8])
    cross = np.cross(np.eye(3), axis)
    matrix = np.eye(3) + np.sin(1.1) * cross + (1 - np.cos(1.1)) * cross @ cross
    return [replace(mesh, positions=(mesh.positions @ matrix.T).astype(np.float32).astype(float)) for mesh in meshes]


@pytest.mark.parametrize(
    "meshes",
    [[], ROOM, ROOM[:3], turned(ROOM), inward_box([0, 0, 0], [1, 2, 3], [0] * 6, outward=True), ROOM[:1]],
    ids=["nothing", "room", "open room", "turned room", "box from outside", "one wall"],
)
def test_on_a_convex_hull_nothing_occludes(meshes):
    found = find_occlusion(meshes)
    assert not found.possible
    assert found.reason.startswith("nothing can occlude anything")


@pytest.mark.parametrize(
    "other",
    [
        quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), name="plate"),
        quad((-1, -1, 0.99), (2, 0, 0), (0, 2, 0), name="plate"),
        quad((0.99, 0, 0), (0.001, 0, 0), (0, 0.001, 0.001), name="plate"),
        quad((3, 0, 0), (0, 1, 0), (0, 0, 1), name="plate"),
    ],
    ids=["in the middle", "before a wall", "small", "outside"],
)
def test_anything_else_may_and_is_named(other):
    # A plate outside is before a wall that is in its way.
    found = find_occlusion([*ROOM, other])
    assert found.possible
    assert "'plate'" in found.reason or "'wall" in found.reason


def test_a_lamp_plate_before_the_ceiling_may_occlude():
    assert find_occlusion(box_room().meshes).possible


def test_source_points_behind_a_wall_may_be_occluded():
    inside, outside = np.array([[0.3, 0.2, 0.1]]), np.array([[0.0, 0.0, 1.5]])
    assert not find_occlusion(ROOM, inside).possible
    assert find_occlusion(ROOM, outside).possible


def test_triangles_without_area_occlude_nothing():
    line = quad((-0.5, 0, 0), (1, 0, 0), (0, 1, 0))
    line.positions[:, 1] = 0.0
    assert not find_occlusion([*ROOM, line]).possible


def test_what_is_not_finite_counts_as_an_occluder():
    broken = quad((-0.5, 0, 0), (1, 0, 0), (0, np.nan, 0))
    assert find_occlusion([*ROOM, broken]).possible


def test_what_takes_too_long_counts_as_an_occluder(monkeypatch):
    monkeypatch.setattr(occluders, "MOST_PAIRS", 10)
    monkeypatch.setattr(occluders, "_AT_ONCE", 8)
    found = find_occlusion(ROOM)
    assert found.possible
    assert "12 triangles" in found.reason
