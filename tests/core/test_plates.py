# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of several lights go behind their surface as a whole: flat before, flat afterwards, and no further."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.surface_shapes import cube, grid, mesh_of, sheet
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.mesh_topology import Rows
from vlm_addon.core.repair import Repair, fix
from vlm_addon.core.sampling import sample_counts, sample_regions
from vlm_addon.core.scene import Mesh

FLOOR = mesh_of(10.0 * (grid(1, 1)[0] - np.array([0.5, 0.5, 0.0])), grid(1, 1)[1])


def lights(vertices: object, triangles: object, onto: object) -> VirtualLightMesh:
    """Lights whose samples are points of themselves that `onto` moves to the surface; their normals stay."""
    places, rows = np.asarray(vertices, np.float64), np.asarray(triangles, np.int32)
    count = len(rows)
    corners = places[rows]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    own = sample_regions(corners, Rows(np.arange(count), np.arange(count + 1)), sample_counts(areas, 16))
    samples = SourceSamples(onto(own.positions), own.normals, own.weights, own.offsets)  # type: ignore[operator]
    grey, none = np.full((count, 3), 0.5, np.float32), np.zeros((count, 3), np.float32)
    ones, tags = np.ones(count, np.float32), np.zeros(count, np.int32)
    return VirtualLightMesh(places, rows, grey, none, ones, tags, tags > 0, samples)


def onto_floor(points: np.ndarray) -> np.ndarray:
    return points * [1.0, 1.0, 0.0]


def quads(vertices: object, onto: object = onto_floor) -> VirtualLightMesh:
    """Four vertices to a quad of two lights."""
    first = 4 * np.arange(len(np.asarray(vertices)) // 4)
    return lights(vertices, (first[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3), onto)


def behind(light_mesh: VirtualLightMesh, meshes: list[Mesh], polygons: object = None) -> Repair:
    """All lights moved behind; by default each two of them are a polygon."""
    each = np.arange(len(light_mesh)) // 2 if polygons is None else polygons
    return fix(kinds.IN_FRONT, light_mesh, meshes, np.arange(len(light_mesh)), polygon_of_light=each)


def again(repair: Repair, light_mesh: VirtualLightMesh, meshes: list[Mesh], polygons: object = None) -> np.ndarray:
    """Vertices after a second press."""
    return behind(repair.applied(light_mesh), meshes, polygons).applied(light_mesh).vertices


@pytest.mark.parametrize("height", [1e-3, 0.1, 3.0])
def test_a_quad_over_one_large_face_goes_down_flat_in_one_press(height: float) -> None:
    square = np.array([[-1.0, -1.0, height], [1.0, -1.0, height], [1.0, 1.0, height], [-1.0, 1.0, height]])
    quad = quads(square)
    repair = behind(quad, [FLOOR])
    moved = repair.applied(quad).vertices
    assert (moved[:, :2] == square[:, :2]).all()
    assert np.ptp(moved[:, 2]) == 0.0
    assert -1e-4 < moved[0, 2] < 0.0
    assert repair.tag_ids is None
    assert repair.sentence == "Moved 2 lights behind the surface"
    assert (repair.strength == 1.0).all()
    np.testing.assert_array_equal(again(repair, quad, [FLOOR]), moved)


def test_a_tilted_quad_keeps_its_tilt_and_is_pushed_by_what_is_under_it_alone() -> None:
    square = np.array([[-1.0, -1.0, 0.1], [1.0, -1.0, 0.2], [1.0, 1.0, 0.2], [-1.0, 1.0, 0.1]])
    quad = quads(square)
    moved = behind(quad, [FLOOR]).applied(quad).vertices
    # Its highest edge comes down to the floor; the floor's corners, 5 m away, would ask for 0.25 m more.
    assert moved[:, 2].max() == pytest.approx(0.0, abs=1e-3)
    assert moved[:, 2].max() < 0.0
    assert moved - square == pytest.approx(np.broadcast_to(moved[0] - square[0], (4, 3)))


def test_a_grid_of_rectangles_goes_as_one_however_uneven_the_ground() -> None:
    top, triangles = sheet(lambda x, y: -0.05 * (x > 0.55), 20, 20)
    ground = mesh_of(top, triangles)
    places = np.array([[x, y, 0.02] for x in (0.2, 0.5, 0.8) for y in (0.2, 0.8)])
    rows = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    strip = lights(places, rows, lambda points: points * [1, 1, 0] - [0, 0, 0.05] * (points[:, :1] > 0.55))
    moved = behind(strip, [ground]).applied(strip).vertices
    assert np.ptp(moved[:, 2]) == pytest.approx(0.0, abs=1e-12)
    assert moved[0, 2] == pytest.approx(-0.05, abs=1e-3)


def test_a_box_of_quads_shrinks_into_the_body_and_stays_a_box() -> None:
    body = mesh_of(*cube(6)[:2])
    places, triangles, *_ = cube(1)
    places, number = np.unique(places, axis=0, return_inverse=True)
    raised, triangles = 1.1 * places, number.ravel()[triangles]
    box = lights(raised, triangles, lambda points: points / 1.1)
    normals = box.area_vectors / box.areas[:, None]
    polygons = np.unique(np.round(normals), axis=0, return_inverse=True)[1].ravel()
    assert len(set(polygons.tolist())) == 6
    repair = behind(box, [body], polygons)
    moved = repair.applied(box).vertices
    assert np.ptp(np.abs(moved)) == pytest.approx(0.0, abs=1e-12)
    assert 0.499 < np.abs(moved).max() < 0.5
    assert repair.strength == pytest.approx(np.full(12, 1.1**2), rel=1e-3)
    np.testing.assert_array_equal(again(repair, box, [body], polygons), moved)


def test_a_quad_goes_into_a_thin_body_only_as_far_as_placement_allows_and_gets_tags() -> None:
    def hollow(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return -0.2 * np.sin(np.pi * x) * np.sin(np.pi * y)

    thickness = 0.02
    top, triangles = sheet(hollow, 12, 12)
    bowl = [mesh_of(top, triangles), mesh_of(top - [0, 0, thickness], triangles[:, ::-1])]
    square = np.array([[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [1.0, 1.0, 0.1], [0.0, 1.0, 0.1]])
    quad = quads(square, lambda points: np.column_stack([points[:, :2], hollow(points[:, 0], points[:, 1])]))
    repair = behind(quad, bowl)
    moved = repair.applied(quad).vertices
    assert np.ptp(moved[:, 2]) == pytest.approx(0.0, abs=1e-12)
    assert -0.5 * thickness < moved[0, 2] < -0.1 * thickness
    assert repair.tag_ids is not None
    assert (repair.tag_ids > 0).all()
    np.testing.assert_array_equal(again(repair, quad, bowl), moved)


def test_single_lights_come_from_far_in_front_in_one_press() -> None:
    places, triangles = grid(8, 8)
    small = lights(places + np.array([0.0, 0.0, 0.3]), triangles, onto_floor)
    repair = behind(small, [FLOOR], np.arange(len(triangles)))
    moved = repair.applied(small).vertices
    assert moved[:, 2].max() < 0.0
    assert moved[:, 2].min() > -1e-3
    assert repair.tag_ids is None
