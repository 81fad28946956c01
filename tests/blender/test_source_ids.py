# SPDX-License-Identifier: GPL-3.0-or-later
"""A light mesh finds the objects that it was made from by ids of their own, whatever they or copies are called."""

import bpy
import pytest

from vlm_addon.blender.light_meshes import add_sources, ensure_id, light_meshes_of, set_sources, sources


@pytest.fixture
def make_lights(make_plane, scene):
    """make_lights(name, *sources): a light mesh made of the objects of these names."""

    def make(name, *names):
        lights = make_plane(name)
        lights["vlm_schema"] = 2
        set_sources(lights, names, scene)
        return lights

    return make


@pytest.fixture
def copy(scene):
    """copy(thing): a copy in the scene, as Shift+D makes it."""

    def make(thing):
        made = thing.copy()
        scene.collection.objects.link(made)
        return made

    return make


def swap_names(one, other):
    names = one.name, other.name
    one.name = "neither"
    other.name, one.name = names


def test_renamed_sources_are_found(make_lights, make_cube, scene):
    cube = make_cube("Cube")
    lights = make_lights("Lights", "Cube")
    cube.name = "Wall"
    make_cube("Cube")
    assert sources(lights, scene) == [cube]
    assert light_meshes_of(cube, scene) == [lights]


def test_the_original_is_preferred_to_its_copies(make_lights, make_cube, copy, scene):
    cube = make_cube("Cube")
    lights = make_lights("Lights", "Cube")
    copy(cube)
    assert sources(lights, scene) == [cube]


def test_a_copy_that_gets_lights_of_its_own_is_told_from_the_original_whatever_they_are_called(
    make_lights, make_cube, copy, scene
):
    cube = make_cube("Cube")
    lights = make_lights("Lights", "Cube")
    other = copy(cube)
    lights_of_other = make_lights("Lights of copy", other.name)
    swap_names(cube, other)
    assert sources(lights, scene) == [cube]
    assert sources(lights_of_other, scene) == [other]


def test_an_original_that_gets_an_id_of_its_own_is_still_known_to_its_first_light_mesh(
    make_lights, make_cube, copy, scene
):
    cube = make_cube("Cube")
    lights = make_lights("Lights", "Cube")
    other = copy(cube)
    again = make_lights("Lights again", "Cube")
    swap_names(cube, other)
    assert sources(lights, scene) == sources(again, scene) == [cube]


def test_ids_that_no_copy_shares_stay(make_cube):
    cube = make_cube("Cube")
    number = ensure_id(cube)
    assert ensure_id(cube) == number


def test_sources_that_are_gone_are_none(make_lights, make_cube, scene):
    cube = make_cube("Cube")
    make_cube("Wall")
    lights = make_lights("Lights", "Cube", "Wall")
    bpy.data.objects.remove(cube)
    make_cube("Cube")["vlm_id"] = 5
    assert sources(lights, scene) == [None, bpy.data.objects["Wall"]]


def shift_d(*things):
    """Duplicate objects as Shift+D does; returns the copies in the same order."""
    bpy.context.view_layer.update()
    for each in bpy.context.view_layer.objects:
        each.select_set(each in things)
    before = {each.name for each in bpy.data.objects}
    bpy.ops.object.duplicate()
    made = sorted((each for each in bpy.data.objects if each.name not in before), key=lambda each: each.name)
    return [next(each for each in made if each.name.startswith(thing.name)) for thing in things]


def test_copies_made_together_belong_together_before_they_are_moved(make_lights, make_cube, scene):
    cube = make_cube("Cube")
    lights = make_lights("Lights", "Cube")
    other, lights_of_other = shift_d(cube, lights)
    assert sources(lights, scene) == [cube]
    assert sources(lights_of_other, scene) == [other]


def test_copies_moved_together_belong_together_whatever_else_was_copied(make_lights, make_cube, scene):
    cube = make_cube("Cube")
    lights = make_lights("Lights", "Cube")
    alone = shift_d(cube)[0]
    other, lights_of_other = shift_d(cube, lights)
    for thing in (other, lights_of_other):
        thing.location.x += 5.0
    alone.location.y = 3.0
    bpy.context.view_layer.update()
    swap_names(cube, alone)
    swap_names(lights, lights_of_other)
    assert sources(lights, scene) == [cube]
    assert sources(lights_of_other, scene) == [other]


def test_two_light_meshes_of_one_object_both_stay_with_it_when_it_is_copied(make_lights, make_cube, copy, scene):
    cube = make_cube("Cube")
    both = [make_lights("Lights", "Cube"), make_lights("More", "Cube")]
    copy(cube)
    assert [sources(each, scene) for each in both] == [[cube], [cube]]


def test_objects_added_to_those_that_lights_were_made_of_do_not_change_where_these_were(
    make_lights, make_cube, copy, scene
):
    cube, _ = make_cube("Cube"), make_cube("Wall")
    lights = make_lights("Lights", "Cube")
    cube.location.x = 5.0
    other = copy(cube)
    other.location.x = 0.0
    bpy.context.view_layer.update()
    add_sources(lights, ["Wall"], scene)
    assert list(lights["vlm_source_places"])[3::12] == [0.0, 0.0]
    assert sources(lights, scene) == [other, bpy.data.objects["Wall"]]


def test_a_name_of_two_lines_is_one_source(make_lights, make_cube, scene):
    cube = make_cube("two\nlines")
    wall = make_cube("Wall")
    assert sources(make_lights("Lights", cube.name, "Wall"), scene) == [cube, wall]
