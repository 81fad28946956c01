# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights of the same objects that are created twice are made anew around what is locked; nothing doubles unsaid."""

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, create_again
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import read_faces, write_faces
from vlm_addon.blender.light_meshes import light_meshes
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.progress import silent


@pytest.fixture
def create(make_cube):
    """create(active, *others): lights of these objects, by Create from Selection; returns what it reports."""
    ensure_scene_settings()
    for place, name in enumerate(("Cube", "Wall", "Table")):
        make_cube(name).location.x = 5.0 * place
    bpy.context.view_layer.update()

    def make(*names, settings=None):
        for each in bpy.context.view_layer.objects:
            each.select_set(each.name in names)
        bpy.context.view_layer.objects.active = bpy.data.objects[names[0]]
        return authoring.write(authoring.from_selection(bpy.context, settings or BakeSettings())(silent))

    return make


def names_of_light_meshes():
    return [thing.name for thing in light_meshes(bpy.context.scene)]


def test_the_same_objects_get_no_second_light_mesh_whichever_is_active(create):
    create("Cube", "Wall")
    told = create("Wall", "Cube")
    assert names_of_light_meshes() == ["VLM Cube"]
    assert ", in place of the 24 faces of VLM Cube" in told


def test_locked_lights_stay_where_lights_are_created_again(create):
    create("Cube")
    lights = bpy.data.objects["VLM Cube"]
    colors = read_faces(lights, "vlm_color")
    colors[:2, :3] = (0.1, 0.2, 7.5)
    write_faces(lights, "vlm_color", colors)
    write_faces(lights, "vlm_lock", np.arange(12) < 2)
    told = create("Cube")
    assert "2 virtual lights of them locked and kept" in told
    locked = read_faces(lights, "vlm_lock") != 0
    assert locked.sum() == 2
    assert read_faces(lights, "vlm_color")[locked][:, 2] == pytest.approx([7.5, 7.5])


def test_more_locked_lights_than_are_asked_for_is_refused(create):
    create("Cube")
    write_faces(bpy.data.objects["VLM Cube"], "vlm_lock", np.ones(12))
    with pytest.raises(InvalidInput, match="12 of its lights are locked, 8 are asked for"):
        create("Cube", settings=BakeSettings(target_triangles=8))


def test_a_larger_selection_takes_the_place_of_a_smaller_one_of_that_name(create):
    create("Cube")
    create("Cube", "Wall")
    assert names_of_light_meshes() == ["VLM Cube"]


def test_no_object_loses_its_lights_to_others_and_what_counts_twice_is_told(create):
    create("Cube", "Wall")
    told = create("Cube", "Table")
    assert names_of_light_meshes() == ["VLM Cube", "VLM Cube.001"]
    assert "'Cube' has bounce light in 'VLM Cube' already, so it counts twice" in told


def test_lights_that_were_drawn_by_hand_stay(create, make_plane):
    make_plane("VLM Cube")["vlm_schema"] = 2
    create("Cube")
    assert names_of_light_meshes() == ["VLM Cube", "VLM Cube.001"]


def test_objects_that_gave_no_light_are_named(create):
    create("Cube", "Wall", "Table")
    bpy.data.objects.remove(bpy.data.objects["Wall"])
    bpy.data.objects["Table"].hide_render = True
    bpy.context.view_layer.objects.active = bpy.data.objects["VLM Cube"]
    told = authoring.write(create_again.again(bpy.context, BakeSettings(), False)(silent))
    assert "'Wall' is gone; 'Table' shows no surface in renders" in told


def test_a_second_scene_keeps_its_one_light_mesh_when_an_object_is_added(make_cube):
    ensure_scene_settings()
    make_cube("Cube")
    from_scene()
    second = bpy.data.scenes.new("Second")
    bpy.context.window.scene = second
    for place, name in enumerate(("Wall", "Table")):
        make_cube(name).location.x = 5.0 * place
        for collection in list(bpy.data.objects[name].users_collection):
            collection.objects.unlink(bpy.data.objects[name])
        second.collection.objects.link(bpy.data.objects[name])
        from_scene()
    assert [thing.name for thing in light_meshes(second)] == ["VLM.001"]


def test_a_name_that_is_too_long_for_blender_is_found_again(create):
    source = bpy.data.objects["Cube"]
    source.name = 63 * "n"
    create(source.name)
    create(source.name, "Wall")
    create("Wall", source.name)
    (name,) = names_of_light_meshes()
    assert name.startswith("VLM nnn")


def test_lights_in_an_excluded_collection_are_said_to_light_nothing(create):
    assert "excluded" not in create("Cube")
    bpy.context.view_layer.layer_collection.children["Virtual Light Meshes"].exclude = True
    told = create("Wall")
    assert "'Virtual Light Meshes' is excluded from the view layer, so they light nothing" in told


def from_scene():
    bpy.context.view_layer.update()
    return authoring.write(authoring.from_scene(bpy.context, BakeSettings())(silent))
