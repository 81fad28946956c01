# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags and links of objects that show the faces of others: told apart by the object where possible, else refused."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.light_faces import write_faces
from vlm_addon.blender.tagging import links
from vlm_addon.blender.tagging.light_tags import assign_tag, tagged_text
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out


@pytest.fixture
def lights(make_mesh):
    thing = make_mesh("lights", [(0, 0, -9), (1, 0, -9), (0, 1, -9)], [(0, 1, 2)])
    thing["vlm_schema"], thing.hide_render = 2, True
    return thing


@pytest.fixture
def twins(make_cube):
    """Two objects of one mesh."""
    one = make_cube("one")
    other = one.copy()
    other.name, other.location.x = "other", 5.0
    bpy.context.scene.collection.objects.link(other)
    return one, other


@pytest.fixture
def instances(make_cube):
    """(cube, two empties that instance it)."""
    group = bpy.data.collections.new("group")
    cube = make_cube("cube", collection=group)
    found = []
    for x in (0.0, 5.0):
        empty = bpy.data.objects.new(f"empty {x:g}", None)
        empty.instance_type, empty.instance_collection, empty.location.x = "COLLECTION", group, x
        bpy.context.scene.collection.objects.link(empty)
        found.append(empty)
    return cube, *found


def choose(*things):
    bpy.context.view_layer.update()
    for each in bpy.context.view_layer.objects:
        each.select_set(each in things)
    bpy.context.view_layer.objects.active = things[0]


def link(receiver):
    bpy.context.view_layer.update()
    return links.link_receivers(bpy.context, links.named_receivers(bpy.context, receiver))


def left_out():
    """For each visible mesh, left to right, whether the light leaves out all of it, none of it or a part."""
    bpy.context.view_layer.update()
    found = extract()
    meshes = sorted(found.snapshot.meshes, key=lambda mesh: mesh.positions[:, 0].min())
    out = [leaves_out(found.light_mesh.links, found.light_mesh.tag_ids[:1], mesh.tag_ids) for mesh in meshes]
    return ["all" if each.all() else "part" if each.any() else "none" for each in out]


def test_one_of_two_objects_of_one_mesh_is_left_out(lights, twins):
    choose(lights)
    link("one")
    assert left_out() == ["all", "none"]


def test_one_of_two_instances_is_left_out(lights, instances):
    choose(lights)
    link(instances[1].name)
    assert left_out() == ["all", "none"]


def test_objects_whose_common_faces_have_ids_cannot_be_told_apart(lights, twins):
    write_faces(twins[0], "vlm_tag", np.array([9, 9, 0, 0, 0, 0]))
    choose(lights)
    with pytest.raises(InvalidInput, match=r"object 'one'.*'other' shows the same faces"):
        link("one")
    assert left_out() == ["none", "none"]
    choose(lights, *twins)
    link("")
    assert left_out() == ["all", "all"]


@pytest.mark.parametrize("on_faces", [False, True])
def test_instances_of_what_has_ids_cannot_be_told_apart(lights, instances, on_faces):
    cube, one, other = instances
    if on_faces:
        write_faces(cube, "vlm_tag", np.array([9] * 6))
    else:
        cube["vlm_tag"] = 9
    choose(lights)
    with pytest.raises(InvalidInput, match="shows the same faces"):
        link(one.name)
    choose(lights, one, other)
    link("")
    assert left_out() == ["all", "all"]


def test_a_tag_for_an_instance_of_what_has_one_is_said_to_be_without_effect(instances):
    cube, one, other = instances
    choose(one)
    assert assign_tag(bpy.context, 4).instanced == 0
    assert sorted(set(np.concatenate([mesh.tag_ids for mesh in extract_meshes()]).tolist())) == [0, 4]
    cube["vlm_tag"] = 9
    choose(other)
    tagged = assign_tag(bpy.context, 5)
    assert tagged.instanced == 1
    assert "keeps its own id" in tagged_text(tagged)


def extract_meshes():
    bpy.context.view_layer.update()
    return extract().snapshot.meshes
