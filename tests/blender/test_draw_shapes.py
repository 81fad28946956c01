# SPDX-License-Identifier: GPL-3.0-or-later
"""Strokes as text, pixels as rays, and the shapes that strokes become."""

import math

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from vlm_addon.blender.drawing.draw_points import directions_of, rows_of, stroke, text_of
from vlm_addon.blender.drawing.draw_shapes import rectangle, simplified, strip, way_in_steps
from vlm_addon.blender.drawing.draw_view import View
from vlm_addon.blender.drawing.drawn_faces import faces_of, plane_of, triangles_of
from vlm_addon.core.errors import InvalidInput

SIZE = (320, 200)
POINTS = np.random.default_rng(2).uniform(-1.0, 1.0, (40, 3))


def test_text_keeps_every_digit():
    rows = np.random.default_rng(1).normal(size=(50, 3)) * 10.0 ** np.arange(-25, 25)[:, None] % 1e7
    assert np.array_equal(rows_of(text_of(rows), "points"), rows)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2", "not three"),
        ("1 2 x", "x"),
        ("nan 0 0", "not finite"),
        ("1e30 0 0", "not finite"),
        ("inf 0 0", "finite"),
    ],
)
def test_what_is_no_point_is_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        rows_of(text, "points")


def test_one_direction_stands_for_all_and_none_for_not_known():
    assert np.array_equal(directions_of("0 0 2", 3, "normals"), [[0, 0, 1]] * 3)
    assert not directions_of("", 3, "normals").any()
    with pytest.raises(InvalidInput, match="2 directions for 3"):
        directions_of("0 0 1, 0 0 1", 3, "normals")
    with pytest.raises(InvalidInput, match="no length"):
        directions_of("0 0 0", 3, "normals")


def test_a_stroke_of_too_few_points_is_refused():
    with pytest.raises(InvalidInput, match="not at least 3"):
        stroke("0 0 0, 1 0 0", "", 3)


@pytest.fixture(params=["PERSP", "ORTHO"])
def camera(request, make_camera):
    """A camera with shift that looks at the origin from afar; returns it and its view."""
    made = make_camera((3.0, -5.0, 2.0), (1.2, 0.1, 0.5))
    made.data.type = request.param
    made.data.shift_x, made.data.shift_y = 0.1, -0.05
    made.data.ortho_scale = 6.0
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    bpy.context.view_layer.update()
    projection = made.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=SIZE[0], y=SIZE[1])
    return made, View(np.array(projection), np.array(made.matrix_world.inverted(), np.float64), SIZE)


def test_points_show_where_blender_shows_them(camera):
    blender_object, view = camera
    expected = [world_to_camera_view(bpy.context.scene, blender_object, Vector(point))[:2] for point in POINTS]
    assert np.allclose(view.pixels(POINTS), np.array(expected) * SIZE, atol=0.02)


def test_the_ray_of_a_pixel_goes_through_the_point_that_shows_there(camera):
    _, view = camera
    for point in POINTS:
        origin, direction, length = view.ray(view.pixels(point[None])[0])
        along = (point - origin) @ direction
        assert np.linalg.norm(origin + along * direction - point) < 1e-5
        assert 0.0 < along < length
        assert abs(np.linalg.norm(direction) - 1.0) < 1e-12


def test_a_pixel_is_as_large_as_the_next_one_is_away(camera):
    _, view = camera
    towards = view.view[2, :3]
    for point in POINTS[:5]:
        pixel = view.pixels(point[None])[0]
        origin, direction, _ = view.ray(pixel + np.array([0.0, 1.0]))
        # In the plane through the point that faces the eye.
        there = origin + direction * ((point - origin) @ towards) / (direction @ towards)
        assert np.linalg.norm(there - point) == pytest.approx(view.metres_per_pixel(point), rel=1e-3)


def test_what_is_behind_the_eye_shows_nowhere(camera):
    _, view = camera
    if view.is_perspective:
        behind = view.view[:3, :3].T @ ([0.0, 0.0, 1.0] - view.view[:3, 3])
        assert np.isnan(view.pixels(behind[None])).all()


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 1, 0), (0.6, 0, 0.8), (-0.48, 0.6, 0.64)])
def test_a_rectangle_lies_in_its_plane_between_its_corners(normal):
    normal = np.array(normal, float)
    first = np.array([0.3, -0.2, 0.7])
    step = np.array([1.0, 2.0, -0.5])
    points, rings = rectangle(first, first + step, normal, np.zeros(3), 3, 2)
    assert np.abs((points - first) @ normal).max() < 1e-12
    assert len(points) == 12
    areas = [plane_of(points[ring])[1] for ring in rings]
    assert np.allclose(areas, areas[0])
    assert np.allclose(points[-1] - first, step - step @ normal * normal)


def test_the_columns_of_a_rectangle_go_along_the_direction_given():
    points, _ = rectangle(np.zeros(3), np.array([2.0, 1.0, 0.0]), np.array([0.0, 0, 1]), np.array([1.0, 1, 5]), 1, 1)
    assert np.allclose(np.cross(points[1] - points[0], [1.0, 1.0, 0.0]), 0.0)


def test_a_rectangle_without_area_is_refused():
    with pytest.raises(InvalidInput, match="one line"):
        rectangle(np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0, 1]), np.array([1.0, 0, 0]), 1, 1)


def test_a_strip_turns_with_the_surface_and_keeps_its_width():
    angles = np.linspace(0.0, math.pi / 2, 7)
    normals = np.column_stack([np.sin(angles), np.zeros(7), np.cos(angles)])
    edge = np.array([(0.0, -0.5, 1.0), (0.0, 0.5, 1.0)])
    points, rings, facing = strip(edge, normals[1:], normals[1:])
    assert np.array_equal(points[:2], edge)
    assert len(rings) == 6
    assert np.array_equal(facing, normals[1:])
    ends = points.reshape(-1, 2, 3)
    assert np.allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1.0)
    assert np.allclose(np.einsum("ij,ij->i", ends[:, 1] - ends[:, 0], normals), 0.0, atol=1e-12)
    assert np.allclose(ends.mean(axis=1)[1:], normals[1:])


def test_a_strip_bends_in_the_corner_of_two_walls():
    edge = np.array([(-1.0, -0.5, 0.0), (-1.0, 0.5, 0.0)])
    path = np.array([(-1.0, 0.0, 0.0), (0.0, 0.0, 0.7)])
    floor, wall = (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0)
    points, rings, facing = strip(edge, path, np.array([floor, wall]))
    assert len(rings) == 2
    assert np.allclose(points[2:4], [(0.0, -0.5, 0.0), (0.0, 0.5, 0.0)])
    assert np.allclose(points[4:], [(0.0, -0.5, 0.7), (0.0, 0.5, 0.7)])
    assert np.allclose(facing, [floor, wall])


def test_a_strip_that_leaves_nothing_is_refused():
    edge = np.array([(0.0, -0.5, 1.0), (0.0, 0.5, 1.0)])
    with pytest.raises(InvalidInput, match="does not leave"):
        strip(edge, np.array([(0.0, 0.0, 1.0)]), np.array([(0.0, 0.0, 1.0)]))


def test_an_outline_keeps_what_it_needs_and_no_more():
    corners = np.array([(0.0, 0.0), (100.0, 0.0), (100.0, 60.0), (0.0, 60.0)])
    sides = [np.linspace(a, b, 20, endpoint=False) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    outline = np.concatenate(sides)
    outline += np.random.default_rng(0).uniform(-1.0, 1.0, outline.shape)
    kept = outline[simplified(outline, 4.0)]
    assert len(kept) == 4
    assert np.abs(kept - corners).max() <= 4.0


def test_steps_of_a_way_end_where_it_ends():
    points = np.column_stack([np.arange(0.0, 1.01, 0.1), np.zeros(11), np.zeros(11)])
    assert way_in_steps(points, 0.38) == [4, 8, 10]
    assert way_in_steps(points, 0.28) == [3, 6, 10]
    assert way_in_steps(points, 5.0) == [10]
    assert way_in_steps(points[:1], 1.0) == []


@pytest.mark.parametrize("turn", [1, -1])
def test_faces_are_turned_to_the_side_that_they_light(turn):
    ring = np.array([(0.0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 0.2, 0), (0, 1, 0)])[::turn]
    faces = faces_of(ring, [[0, 1, 2, 3, 4]], np.array([[0.0, 0.0, -1.0]]))
    assert plane_of(faces.points[list(faces.corners[0])])[0] == pytest.approx([0, 0, -1])
    triangles, owners = triangles_of(faces)
    vectors = np.cross(ring[triangles[:, 1]] - ring[triangles[:, 0]], ring[triangles[:, 2]] - ring[triangles[:, 0]])
    assert (vectors[:, 2] < 0.0).all()
    assert 0.5 * np.abs(vectors[:, 2]).sum() == pytest.approx(plane_of(ring)[1])
    assert owners.tolist() == [0, 0, 0]


def test_a_face_that_is_not_flat_becomes_triangles():
    ring = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0.2), (0, 1, 0)])
    assert len(faces_of(ring, [[0, 1, 2, 3]], np.zeros((1, 3))).corners) == 2
    ring[2, 2] = 1e-6
    assert len(faces_of(ring, [[0, 1, 2, 3]], np.zeros((1, 3))).corners) == 1
