# SPDX-License-Identifier: GPL-3.0-or-later
"""The check tells of lights that count twice, and not of any that were just created."""

import bmesh
import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking
from vlm_addon.blender.drawing import draw_lights
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_meshes import light_meshes
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.progress import silent

SCENES = ("cornell_box", "monkey_box", "dancer", "hard_cases", "lightwave_room", "atrium")
FEW = [("cornell_box", 50), ("dancer", 200), ("hard_cases", 200)]
"""Of the last, lights of one creation lie across each other."""


def create(count):
    bpy.context.view_layer.update()
    made = authoring.from_scene(bpy.context, BakeSettings(target_triangles=count))(silent)
    authoring.write(made)
    bpy.context.view_layer.update()
    return {each.kind for each in made.bake.findings}


def counted_twice():
    """(object, face) of each light that the check says counts twice."""
    bpy.context.view_layer.update()
    checked = checking.check(bpy.context)(silent)
    rows = [row for each in checked.findings if each.kind == kinds.OVERLAPPING for row in each.lights]
    found = checked.origins.faces_by_object(rows) if rows else {}
    return {(name, face) for name, faces in found.items() for face in faces.tolist()}


def assert_fresh_lights_count_once(sample_folder, name, count):
    bpy.ops.wm.open_mainfile(filepath=str(sample_folder / f"{name}.blend"))
    ensure_scene_settings()
    for thing in light_meshes(bpy.context.scene):
        bpy.data.objects.remove(thing)
    assert kinds.OVERLAPPING not in create(count)
    assert not counted_twice()


@pytest.mark.parametrize(("name", "count"), FEW)
def test_fresh_lights_of_sample_scenes_count_once(sample_folder, name, count):
    assert_fresh_lights_count_once(sample_folder, name, count)


@pytest.mark.full
@pytest.mark.parametrize("count", [50, 200, 1000, 5000])
@pytest.mark.parametrize("name", SCENES)
def test_fresh_lights_of_all_sample_scenes_count_once(sample_folder, name, count):
    assert_fresh_lights_count_once(sample_folder, name, count)


@pytest.fixture
def ball():
    """A light mesh of 60 lights of a ball of 1,280 triangles."""
    ensure_scene_settings()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    create(60)
    assert not counted_twice()
    return next(iter(light_meshes(bpy.context.scene)))


def test_a_second_light_mesh_of_the_same_surface_is_told(ball):
    """Creation would take the place of the first, so it is appended, or made by hand."""
    first = ball.copy()
    first.data = ball.data.copy()
    first["vlm_sources"] = ""
    ball.users_collection[0].objects.link(first)
    create(240)
    found = counted_twice()
    (told,) = {name for name, _ in found}
    assert len(found) > 0.9 * len(bpy.data.objects[told].data.polygons)


def test_a_light_that_is_duplicated_and_moved_a_little_is_told(ball):
    count = len(ball.data.polygons)
    mesh = bmesh.new()
    mesh.from_mesh(ball.data)
    mesh.faces.ensure_lookup_table()
    size = np.sqrt(mesh.faces[7].calc_area())
    copied = bmesh.ops.duplicate(mesh, geom=[mesh.faces[7]])["geom"]
    for each in copied:
        if isinstance(each, bmesh.types.BMVert):
            each.co *= 1.0 - 0.01 * size
    mesh.to_mesh(ball.data)
    mesh.free()
    assert len(ball.data.polygons) == count + 1
    assert counted_twice() in ({(ball.name, 7)}, {(ball.name, count)})


def test_lights_drawn_over_created_ones_are_told(make_plane):
    ensure_scene_settings()
    make_plane("floor", size=4.0)
    create(2)
    (lights,) = light_meshes(bpy.context.scene)
    count = len(lights.data.polygons)
    points = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], np.float64)
    draw_lights.draw(bpy.context, points, [[0, 1, 2, 3]], np.array([[0.0, 0.0, 1.0]]), 0.0, lights.name)
    assert counted_twice() == {(lights.name, count)}
