# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes in which nothing can stand between two surfaces are told from those in which something may."""

from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import inward_box
from tests.render.rooms import box_room, quad
from vlm_addon.core import occluders
from vlm_addon.core.lamps import lamp_hull
from vlm_addon.core.occluders import find_occlusion, occluding_triangles
from vlm_addon.core.scene import SUN, Light

NOWHERE = np.zeros((0, 3))
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


def masks(meshes, sources, directions=NOWHERE):
    return occluding_triangles(meshes, find_occlusion(meshes, sources, directions), sources, directions)


def test_a_sun_counts_as_a_point_without_end():
    floor = ROOM[4:5]
    for towards, possible in (((0.3, 0.2, 1.0), False), ((0.3, 0.2, -1.0), False), ((0.0, 0.0, 1.0), False)):
        assert find_occlusion(floor, None, np.array([towards])).possible == possible
    # Seen from both sides at once, the floor is between one of the suns and whoever is beyond.
    assert find_occlusion(floor, None, np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])).possible
    assert find_occlusion(ROOM, None, np.array([(0.3, 0.2, 1.0)])).possible


def test_a_wide_sun_is_held_by_its_hull():
    sun = Light("sun", SUN, (1.0,) * 3, (0.0,) * 3, angle=0.5, z_axis=(0.0, 0.0, 1.0))
    hull = lamp_hull(sun)
    hull /= np.linalg.norm(hull, axis=1, keepdims=True)
    assert (hull[:, 2] < np.cos(0.25)).all()
    assert np.sign(hull[:, :2]).prod(axis=1).sum() == 0.0


@pytest.mark.parametrize("place", [(0.3, 0.2, 0.5), (0.0, 0.0, 3.0)], ids=["lamp inside", "lamp outside"])
def test_triangles_that_are_no_occluders_stop_no_ray(place):
    block = inward_box([-0.6, -0.5, -1.0], [0.1, 0.3, -0.2], [0] * 6, outward=True)
    meshes, random = [*ROOM, *block], np.random.default_rng(2)
    found = masks(meshes, np.array([place]))
    assert any(mask.any() for mask in found)
    assert not all(mask.all() for mask in found)
    ends = np.concatenate([points_on(mesh, random, 200) for mesh in meshes])
    for mesh, mask in zip(meshes, found, strict=True):
        for corners in mesh.positions[mesh.triangles[~mask]]:
            assert not crosses(np.array(place), ends, corners).any()


def test_walls_around_a_lamp_are_no_occluders_and_things_are():
    block = inward_box([-0.6, -0.5, -1.0], [0.1, 0.3, -0.2], [0] * 6, outward=True)
    inside = masks([*ROOM, *block], np.array([(0.3, 0.2, 0.5)]))
    assert not any(mask.any() for mask in inside[:6])
    assert sum(mask.all() for mask in inside[6:]) >= 5
    outside = masks([*ROOM, *block], np.array([(0.3, 0.2, 1.5)]))
    assert outside[5].all()


def test_too_many_to_compare_all_count(monkeypatch):
    monkeypatch.setattr(occluders, "MOST_PAIRS_FOR_EACH", 10)
    plate = quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))
    assert masks([*ROOM, plate], np.zeros((1, 3))) is None


def points_on(mesh, random, count):
    """(count, 3) random points of its first triangle and its second."""
    u, v = random.random((2, count, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = (mesh.positions[mesh.triangles[random.integers(0, len(mesh.triangles), count), k]] for k in range(3))
    return a + u * (b - a) + v * (c - a)


def crosses(start, ends, corners):
    """Which segments from `start` to (n, 3) `ends` pass through a triangle's inside, both ends off its plane."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    before, beyond = (start - corners[0]) @ normal, (ends - corners[0]) @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        meeting = start + (before / (before - beyond))[:, None] * (ends - start)
    sides = [np.cross(corners[(k + 1) % 3] - corners[k], meeting - corners[k]) @ normal > 1e-9 for k in range(3)]
    return (np.abs(beyond) > 1e-9) & (before * beyond < -1e-12) & np.logical_and.reduce(sides)
