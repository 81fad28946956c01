# SPDX-License-Identifier: GPL-3.0-or-later
"""A ray of the eyedropper meets the nearest visible surface and no light mesh, wherever that lies."""

import bpy
import pytest
from mathutils import Vector

from vlm_addon.blender.eyedropper import surface_along

DOWN, UP = Vector((0, 0, -1)), Vector((0, 0, 1))


@pytest.fixture
def lights(make_plane):
    """A light mesh in the plane z = 0."""
    thing = make_plane("lights", size=4.0)
    thing["vlm_schema"] = 2
    return thing


def met(origin, direction):
    bpy.context.view_layer.update()
    return surface_along(bpy.context.scene, bpy.context.evaluated_depsgraph_get(), Vector(origin), direction)


@pytest.mark.parametrize("height", [3.0, 500.0])
def test_the_nearest_surface_is_met(make_plane, height):
    near, far = make_plane("near"), make_plane("far")
    far.location.z = -1.0
    near.scale = (1.0, 0.5, 2.0)
    point, thing = met((0.5, 0.25, height), DOWN)
    assert thing == near
    assert tuple(point) == pytest.approx((0.5, 0.25, 0.0), abs=1e-4)


@pytest.mark.parametrize("direction", [DOWN, UP])
@pytest.mark.parametrize("distance", [3.0, 500.0])
def test_lights_in_the_plane_of_their_surface_are_passed(lights, make_plane, direction, distance):
    floor = make_plane("floor")
    assert met(-distance * direction, direction)[1] == floor


def test_lights_alone_are_no_surface(lights):
    assert met((0, 0, 3), DOWN) is None


def test_what_renders_do_not_show_is_passed(make_plane):
    hidden, shown = make_plane("hidden"), make_plane("shown")
    hidden.hide_render, shown.location.z = True, -1.0
    assert met((0, 0, 3), DOWN)[1] == shown


def test_instances_are_met_where_they_are(make_plane, scene):
    group = bpy.data.collections.new("group")
    plane = make_plane(collection=group)
    instance = bpy.data.objects.new("instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.location = (10.0, 0.0, 1.0)
    scene.collection.objects.link(instance)
    point, thing = met((10, 0, 5), DOWN)
    assert (thing, point.z) == (plane, pytest.approx(1.0))
    assert met((0, 0, 5), DOWN) is None


def test_a_mesh_that_is_being_edited_is_met(make_plane):
    plane = make_plane()
    bpy.context.view_layer.objects.active = plane
    bpy.ops.object.mode_set(mode="EDIT")
    assert met((0, 0, 3), DOWN)[1] == plane


def test_a_flattened_object_stops_nothing(make_plane):
    flat, floor = make_plane("flat"), make_plane("floor")
    flat.scale, flat.location.z = (0.0, 0.0, 0.0), 1.0
    assert met((0, 0, 3), DOWN)[1] == floor


def test_text_is_met(scene):
    text = bpy.data.objects.new("text", bpy.data.curves.new("text", "FONT"))
    text.data.body = "■"
    scene.collection.objects.link(text)
    bpy.context.view_layer.update()
    x, y, _ = (0.5 * sum(corner[axis] for corner in text.bound_box) / 4 for axis in range(3))
    assert met((x, y, 3), DOWN)[1] == text
