# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairing and leaving out in one scene: neither takes bounce away that the other did not mean, nor gives it back."""

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import read_faces, write_faces
from vlm_addon.blender.tagging import links, tag_pairing
from vlm_addon.blender.tagging.light_tags import assign_tag
from vlm_addon.blender.tagging.source_faces import read_source_faces
from vlm_addon.blender.tagging.source_tags import faces_to_tag
from vlm_addon.blender.tagging.stored_links import read_links, read_paired_links
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.progress import silent
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC

CONTEXT = bpy.context


@pytest.fixture
def room(make_mesh, make_plane):
    """A floor of 4 x 4 faces over 4 lights, a plate of one face over 2 more, all in one light mesh, and a far plane."""
    steps = np.linspace(-1, 1, 5)
    vertices = [(x, y, 0) for y in steps for x in steps]
    faces = [(i + 5 * j, i + 1 + 5 * j, i + 6 + 5 * j, i + 5 + 5 * j) for j in range(4) for i in range(4)]
    floor, plate, far = make_mesh("floor", vertices, faces), make_plane("plate"), make_plane("far")
    plate.location.x, far.location.x = 10.0, 30.0
    squares = [(x, y, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)] + [(9.5, 0, 0.5), (10.5, 0, 0.5)]
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    points = [(x + h * dx, y + h * dy, -0.1) for x, y, h in squares for dx, dy in corners]
    lights = make_mesh("lights", points, [tuple(range(4 * i, 4 * i + 4)) for i in range(len(squares))])
    lights["vlm_schema"] = 2
    lights.hide_render = True
    bpy.context.view_layer.update()
    return floor, plate, far, lights


def choose(*things):
    bpy.context.view_layer.update()
    for each in bpy.context.view_layer.objects:
        each.select_set(each in things)
    bpy.context.view_layer.objects.active = things[0]


def pair(lights):
    bpy.context.view_layer.update()
    made = tag_pairing.pair(tag_pairing.read_tagging(CONTEXT, [lights]), silent)
    return tag_pairing.write_retagged(CONTEXT, made)


def link():
    return links.link_receivers(CONTEXT, links.named_receivers(CONTEXT, ""))


def unlink():
    return links.unlink_receivers(CONTEXT, links.named_receivers(CONTEXT, ""))


def left_out():
    """{object: (lights, its triangles) bool}, as the renderer would have it."""
    bpy.context.view_layer.update()
    found = extract()
    mesh = found.light_mesh
    return {
        each.name: leaves_out(mesh.links, mesh.tag_ids[:, None], each.tag_ids[None]) for each in found.snapshot.meshes
    }


def own():
    """The same for own lights alone: by place."""
    found = extract()
    low, high = found.light_mesh.corners.min(axis=1), found.light_mesh.corners.max(axis=1)
    result = {}
    for each in found.snapshot.meshes:
        corners = each.positions[each.triangles]
        apart = (corners.max(axis=1)[None] <= low[:, None] + 1e-6) | (corners.min(axis=1)[None] >= high[:, None] - 1e-6)
        result[each.name] = ~apart[:, :, :2].any(axis=2)
    return result


def assert_same(found, wanted):
    assert found.keys() == wanted.keys()
    for name, value in wanted.items():
        assert np.array_equal(found[name], value), name


def united(one, other):
    return {name: one[name] | other[name] for name in one}


def test_own_lights_are_what_the_pairing_of_a_plain_scene_leaves_out(room):
    pair(room[3])
    assert_same(left_out(), own())
    # Two triangles to a light and to a face.
    assert own()["floor"].sum() == 2 * 2 * 16
    assert own()["plate"].sum() == 2 * 2 * 2


@pytest.mark.parametrize("receiver", [0, 1, 2], ids=["floor", "plate", "far"])
def test_pairing_after_leaving_out_an_object_adds_own_lights_alone(room, receiver):
    lights = room[3]
    choose(lights, room[receiver])
    link()
    before = left_out()
    pair(lights)
    assert_same(left_out(), united(before, own()))


def test_pairing_after_one_tag_for_all_lights_adds_own_lights_alone(room):
    choose(room[3])
    assign_tag(CONTEXT, 0)
    pair(room[3])
    assert_same(left_out(), own())


def test_pairing_after_a_tag_of_some_lights_and_faces_adds_own_lights_alone(room):
    floor, _, far, lights = room
    write_faces(lights, "vlm_tag", np.array([5, 5, 0, 0, 5, 0]))
    write_faces(floor, "vlm_tag", np.array([5] * 3 + [6] * 3 + [0] * 10))
    far["vlm_tag"] = 5
    before = left_out()
    pair(lights)
    after = left_out()
    assert_same(after, united(before, own()))
    assert pair(lights) == tag_pairing.Written(0, 0, 0, 0)


def test_lighting_again_takes_away_what_the_artist_left_out_alone(room):
    lights, far = room[3], room[2]
    pair(lights)
    stored = read_links(lights).tolist()
    choose(lights, room[0], far)
    link()
    assert left_out()["floor"].all()
    assert left_out()["far"].all()
    unlink()
    assert_same(left_out(), own())
    assert read_links(lights).tolist() == read_paired_links(lights).tolist() == stored
    choose(lights)
    assert unlink().pairs == 0, "links that pairing has made are not the artist's"


def test_lighting_again_after_leaving_out_and_pairing(room):
    """The ids that lights had when they were left out are others now."""
    lights, far = room[3], room[2]
    choose(lights, far)
    link()
    pair(lights)
    choose(lights, far)
    assert unlink().pairs > 0
    assert_same(left_out(), own())
    assert all(link[0] >= FIRST_AUTOMATIC for link in read_links(lights).tolist())


def test_ids_that_leaving_out_gave_go_with_it_and_pairing_finds_the_scene_as_it_was(room):
    """An id left on the floor would go to all its lights, which black it out."""
    lights, floor = room[3], room[0]
    choose(lights, floor)
    link()
    unlink()
    assert "vlm_tag" not in floor
    assert not read_faces(lights, "vlm_tag").any()
    pair(lights)
    assert_same(left_out(), own())


def test_ids_that_are_good_for_something_stay(room):
    floor, plate, far, lights = room
    floor["vlm_tag"], plate["vlm_tag"], far["vlm_tag"] = 5, 6, 7
    write_faces(lights, "vlm_tag", np.array([5, 5, 8, 8, 9, 9]))
    choose(lights, plate, far)
    link()
    unlink()
    assert floor["vlm_tag"] == 5
    assert "vlm_tag" not in plate
    assert read_faces(lights, "vlm_tag").tolist() == [5, 5, 0, 0, 0, 0]


def test_an_object_keeps_its_tag_where_its_faces_are_paired(room):
    floor, lights = room[0], room[3]
    choose(lights, floor)
    link()
    write_faces(lights, "vlm_tag", np.array([0, 0, 0, 0, 1, 1]))
    pair(lights)
    tag = floor["vlm_tag"]
    assert tag < FIRST_AUTOMATIC
    assert (read_faces(floor, "vlm_tag") >= FIRST_AUTOMATIC).all()


def test_links_of_other_light_meshes_hold_for_faces_that_get_new_ids(room, make_mesh):
    """Another light mesh leaves out the floor; pairing gives the floor's faces ids of their own."""
    floor, lights = room[0], room[3]
    other = make_mesh("other", [(0, 0, 9), (1, 0, 9), (0, 1, 9)], [(0, 1, 2)])
    other["vlm_schema"], other.hide_render = 2, True
    choose(other, floor)
    link()
    before = left_out()
    assert before["floor"].any(axis=1).sum() == 1
    pair(lights)
    of_other = before["floor"].any(axis=1)
    wanted = {name: before[name] | (value & ~of_other[:, None]) for name, value in own().items()}
    assert_same(left_out(), wanted)


@pytest.mark.parametrize("tag_regions", [False, True])
def test_creating_lights_of_an_object_that_is_left_out_does_not_black_it_out(make_cube, make_plane, tag_regions):
    ensure_scene_settings()
    cube, plane = make_cube("cube"), make_plane("plane")
    plane.location.z = -3.0
    bpy.context.view_layer.update()
    settings = BakeSettings(target_triangles=20)
    authoring.write(authoring.from_scene(CONTEXT, settings)(silent))
    choose(next(thing for thing in bpy.data.objects if "vlm_schema" in thing), cube)
    link()
    assert left_out()["cube"].all()
    authoring.write(authoring.from_scene(CONTEXT, settings, tag_regions=tag_regions)(silent))
    assert cube["vlm_tag"] < FIRST_AUTOMATIC
    assert not left_out()["cube"].all(axis=0).any(), "its own other sides light it"


def test_lights_that_are_made_anew_give_faces_the_ids_back_that_an_artist_gave(room):
    floor, lights = room[0], room[3]
    write_faces(floor, "vlm_tag", np.array([5] * 6 + [0] * 10))
    write_faces(lights, "vlm_tag", np.array([6] * 6))
    pair(lights)
    assert (read_faces(floor, "vlm_tag") >= FIRST_AUTOMATIC).all()
    source = read_source_faces().by_face()
    first = next(place.first for place in source.places if place.of_mesh and place.name == "floor")
    tags = faces_to_tag(source, CONTEXT.scene, lights, []).tags[first : first + 16]
    assert tags.tolist() == [5] * 6 + [0] * 10
