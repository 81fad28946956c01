# SPDX-License-Identifier: GPL-3.0-or-later
"""Links between lights and visible objects: stored, read, made and taken away, in object mode and in edit mode."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.evaluation import with_render_depsgraph
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.light_faces import select_faces
from vlm_addon.blender.tagging import links
from vlm_addon.blender.tagging.stored_links import read_links
from vlm_addon.blender.write_back import write_light_mesh
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh


@pytest.fixture
def make_lights(make_mesh):
    """make_lights(name, tags): a light mesh of one triangle for each tag, under z = 0."""

    def make(name="lights", tags=(0, 0)):
        corners = [(x + dx, dy, -0.1) for x in range(len(tags)) for dx, dy in ((0, 0), (1, 0), (0, 1))]
        thing = make_mesh(name, corners, [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(tags))])
        thing["vlm_schema"] = 2
        thing.hide_render = True
        if any(tags):
            tag_faces(thing, tags)
        return thing

    return make


def tag_faces(thing, tags):
    thing.data.attributes.new("vlm_tag", "INT", "FACE").data.foreach_set("value", np.array(tags, np.int32))


def face_tags(thing):
    return [each.value for each in thing.data.attributes["vlm_tag"].data]


def choose(*things):
    bpy.context.view_layer.update()
    for each in bpy.context.view_layer.objects:
        each.select_set(each in things)
    bpy.context.view_layer.objects.active = things[0]


def link(receiver=""):
    return links.link_receivers(bpy.context, links.named_receivers(bpy.context, receiver))


def unlink(receiver=""):
    return links.unlink_receivers(bpy.context, links.named_receivers(bpy.context, receiver))


def left_out(light, receiver):
    """Whether every light of an object leaves out every triangle of a receiver, as extraction has them."""
    found = extract()
    surface = next(mesh for mesh in found.snapshot.meshes if mesh.name == receiver.name)
    of_lights = np.isin(found.light_mesh.tag_ids, face_tags(light))
    tags = found.light_mesh.tag_ids[of_lights]
    return bool(leaves_out(found.light_mesh.links, tags[:, None], surface.tag_ids).all())


def test_untagged_lights_and_objects_get_ids_of_their_own(make_plane, make_lights):
    floor, other, lights = make_plane("floor"), make_plane("other"), make_lights()
    other["vlm_tag"] = 40
    choose(lights, floor)
    linked = link()
    assert (linked.pairs, linked.lights, linked.receivers, linked.more_lights, linked.more_receivers) == (1, 2, 1, 0, 0)
    assert face_tags(lights) == [41, 41]
    assert floor["vlm_tag"] == 42
    assert list(lights["vlm_links"]) == [41, 42]
    assert left_out(lights, floor)
    assert not left_out(lights, other)


def test_ids_that_are_there_are_used(make_plane, make_lights):
    floor, lights = make_plane("floor"), make_lights(tags=(3, 7))
    floor["vlm_tag"] = 7
    choose(lights, floor)
    assert link().pairs == 1
    assert list(lights["vlm_links"]) == [3, 7]
    assert face_tags(lights) == [3, 7]
    assert left_out(lights, floor)


def test_faces_of_a_receiver_that_have_ids_are_left_out_as_well(make_cube, make_lights):
    cube, lights = make_cube("cube"), make_lights(tags=(3, 3))
    tag_faces(cube, [0, 5, 0, 6, 0, 0])
    choose(lights, cube)
    link()
    assert list(lights["vlm_links"]) == [3, 5, 3, 6, 3, 7]
    assert left_out(lights, cube)


def test_ids_of_links_whose_objects_are_gone_are_not_given_again(make_plane, make_lights):
    floor, lights = make_plane("floor"), make_lights()
    choose(lights, floor)
    link()
    bpy.data.objects.remove(floor)
    wall = make_plane("wall")
    choose(lights, wall)
    link()
    assert wall["vlm_tag"] == 3
    assert list(lights["vlm_links"]) == [1, 2, 1, 3]


def test_only_chosen_faces_are_linked_in_edit_mode(make_plane, make_lights):
    floor, lights = make_plane("floor"), make_lights(tags=(0, 0, 0))
    choose(lights, floor)
    select_faces(lights, np.array([False, True, False]))
    bpy.ops.object.mode_set(mode="EDIT")
    linked = link("floor")
    bpy.ops.object.mode_set(mode="OBJECT")
    assert linked.lights == 1
    assert face_tags(lights) == [0, 1, 0]
    assert list(lights["vlm_links"]) == [1, 2]


def test_what_shares_a_tag_is_told(make_plane, make_lights):
    floor, twin, lights = make_plane("floor"), make_plane("twin"), make_lights(tags=(3,))
    more = make_lights("more", (3, 3))
    floor["vlm_tag"] = twin["vlm_tag"] = 9
    choose(lights, floor)
    linked = link()
    assert (linked.more_lights, linked.more_receivers) == (2, 1)
    assert links.linked_text(linked) == (
        "1 virtual light leaves out 1 object; so it is for 2 virtual lights and 1 object of the same tags"
    )
    assert left_out(more, twin)


def test_unlinking_takes_away_the_pairs_of_the_receiver_or_all(make_plane, make_lights):
    floor, wall, lights = make_plane("floor"), make_plane("wall"), make_lights()
    choose(lights, floor, wall)
    link()
    assert len(read_links(lights)) == 2
    assert unlink("floor").pairs == 1
    assert not left_out(lights, floor)
    assert left_out(lights, wall)
    choose(lights)
    assert unlink().pairs == 1
    assert "vlm_links" not in lights
    assert unlink().pairs == 0


def links_in_render():
    """The links that the next F12 reads, of light meshes that are hidden from renders."""
    bpy.context.view_layer.update()
    return with_render_depsgraph(
        bpy.context.scene, bpy.context.view_layer, lambda graph: extract(depsgraph=graph).light_mesh.links.tolist()
    )


def test_a_render_knows_new_links_and_tags_and_forgets_old_ones(make_plane, make_lights):
    floor, lights = make_plane("floor"), make_lights(tags=(3, 3))
    choose(lights, floor)
    assert links_in_render() == []
    link()
    assert links_in_render() == [[3, 4]]
    assert floor.evaluated_get(bpy.context.evaluated_depsgraph_get())["vlm_tag"] == 4
    unlink()
    assert links_in_render() == []


def test_a_pair_that_another_light_mesh_stores_is_taken_away_there(make_plane, make_lights):
    floor, first, second = make_plane("floor"), make_lights("first", (3,)), make_lights("second", (3, 4))
    choose(second, floor)
    link()
    choose(first, floor)
    unlink()
    assert read_links(second).tolist() == [[4, floor["vlm_tag"]]]


def test_an_instancer_is_a_receiver_with_all_that_it_shows(make_plane, make_lights):
    collection = bpy.data.collections.new("props")
    make_plane("tagged", collection=collection)["vlm_tag"] = 5
    make_plane("bare", collection=collection)
    instancer = bpy.data.objects.new("instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(instancer)
    lights = make_lights(tags=(2, 2))
    choose(lights, instancer)
    link()
    found = extract()
    assert len(found.snapshot.meshes) == 2
    for mesh in found.snapshot.meshes:
        assert leaves_out(found.light_mesh.links, 2, mesh.tag_ids).all(), mesh.name


def test_links_survive_saving_renaming_and_creating_anew(make_plane, make_lights, tmp_path):
    floor, lights = make_plane("floor"), make_lights(tags=(3, 4))
    choose(lights, floor)
    link()
    floor.name, lights.name = "ground", "VLM"
    path = str(tmp_path / "linked.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    lights, ground = bpy.data.objects["VLM"], bpy.data.objects["ground"]
    assert left_out(lights, ground)
    samples = SourceSamples(
        np.zeros((1, 3)), np.zeros((1, 3), np.float32), np.ones(1, np.float32), np.arange(2, dtype=np.int32)
    )
    anew = VirtualLightMesh(
        vertices=np.array([[0, 0, -0.1], [1, 0, -0.1], [0, 1, -0.1]], np.float64),
        triangles=np.array([[0, 1, 2]], np.int32),
        colour=np.ones((1, 3), np.float32),
        emission=np.zeros((1, 3), np.float32),
        strength=np.ones(1, np.float32),
        tag_ids=np.array([4], np.int32),
        dynamic=np.zeros(1, bool),
        samples=samples,
        links=np.array([[4, 70]], np.int32),
    )
    write_light_mesh(anew, "VLM")
    assert read_links(lights).tolist() == [[4, ground["vlm_tag"]], [4, 70]], "3 is gone, so is what it left out"
    assert extract().light_mesh.links.tolist() == read_links(lights).tolist()


@pytest.mark.parametrize("value", [[1, 2, 3], "3 4", [1.5, 2.0], 7], ids=["odd", "text", "floats", "a number"])
def test_a_property_that_holds_no_pairs_is_named(make_plane, make_lights, value):
    make_plane()
    lights = make_lights(tags=(1, 2))
    lights["vlm_links"] = value
    with pytest.raises(InvalidInput, match=r"lights.*vlm_links"):
        extract()


def test_nothing_changes_where_linking_is_refused(make_plane, make_lights):
    make_plane("floor")
    lights = make_lights()
    choose(lights)
    for receiver, reason in (("", "no object"), ("ceiling", "no object of this name"), ("lights", "light mesh")):
        with pytest.raises(InvalidInput, match=reason):
            link(receiver)
    choose(bpy.data.objects["floor"])
    with pytest.raises(InvalidInput, match="no light is chosen"):
        link()
    assert "vlm_links" not in lights
    assert "vlm_tag" not in lights.data.attributes
    assert "vlm_tag" not in bpy.data.objects["floor"]


def test_an_object_linked_from_another_file_needs_a_tag_there(make_plane, make_lights, tmp_path):
    path = str(tmp_path / "library.blend")
    make_plane("stage")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["stage"]
    stage = wanted.objects[0]
    bpy.context.scene.collection.objects.link(stage)
    lights = make_lights()
    choose(lights, stage)
    with pytest.raises(InvalidInput, match=r"stage.*linked from another file"):
        link()
    assert "vlm_links" not in lights
    assert "vlm_tag" not in lights.data.attributes


def test_the_objects_that_can_be_left_out_are_offered_by_name(make_plane, make_lights):
    make_plane("Wall")
    make_plane("Small wall")
    make_plane("Floor")
    make_lights("Wall lights")
    assert links.receiver_names(bpy.context, "WALL") == ["Small wall", "Wall"]
    assert links.receiver_names(bpy.context, "") == ["Floor", "Small wall", "Wall"]
