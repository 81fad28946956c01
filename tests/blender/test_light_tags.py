# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags by hand, the faces that evaluated triangles lead back to, and tags found by place."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.light_faces import read_faces, select_faces, write_faces
from vlm_addon.blender.tag_separation import separate
from vlm_addon.blender.tagging import light_tags, links, tag_pairing
from vlm_addon.blender.tagging.light_tags import assign_tag, clear_tag, tag_problem, unused_tag
from vlm_addon.blender.tagging.source_faces import NO_FACE, read_source_faces
from vlm_addon.blender.tagging.stored_links import read_links, write_links
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.progress import silent
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC

CONTEXT = bpy.context


@pytest.fixture
def make_lights(make_mesh):
    """make_lights(*squares, name): square lights (middle, half edge) that face up, in one light mesh; selected."""

    def make(*squares, name="lights", sources=()):
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        vertices = [(x + h * dx, y + h * dy, z) for (x, y, z), h in squares for dx, dy in corners]
        thing = make_mesh(name, vertices, [tuple(range(4 * i, 4 * i + 4)) for i in range(len(squares))])
        thing["vlm_schema"] = 2
        thing["vlm_sources"] = "\n".join(sources)
        thing.hide_render = True
        return thing

    return make


@pytest.fixture
def make_grid(make_mesh):
    """make_grid(name, sides): a square of edge 2 in z = 0, facing up, of sides x sides faces."""

    def make(name="grid", sides=4, **links):
        steps = np.linspace(-1, 1, sides + 1)
        vertices = [(x, y, 0) for y in steps for x in steps]
        row = sides + 1
        faces = [
            (i + row * j, i + 1 + row * j, i + 1 + row + row * j, i + row + row * j)
            for j in range(sides)
            for i in range(sides)
        ]
        return make_mesh(name, vertices, faces, **links)

    return make


def select(*things):
    bpy.context.view_layer.update()
    for thing in bpy.context.view_layer.objects:
        thing.select_set(thing in things)
    bpy.context.view_layer.objects.active = things[0]


def edit(thing, *faces):
    chosen = np.zeros(len(thing.data.polygons), bool)
    chosen[list(faces)] = True
    select_faces(thing, chosen)


def tags(thing):
    return read_faces(thing, "vlm_tag").tolist()


def run(step, *things, objects=()):
    """One of the steps of tag_pairing on light meshes, written."""
    bpy.context.view_layer.update()
    made = step(tag_pairing.read_tagging(CONTEXT, list(things), list(objects)), silent)
    return made, tag_pairing.write_retagged(CONTEXT, made)


def left_out():
    """(lights, triangles) bool as the renderer would have it: which lights each visible triangle leaves out."""
    found = extract()
    of_triangles = np.concatenate([mesh.tag_ids for mesh in found.snapshot.meshes])
    return leaves_out(found.light_mesh.links, found.light_mesh.tag_ids[:, None], of_triangles[None])


def test_an_object_and_its_light_mesh_get_one_new_id(make_cube, make_lights):
    cube, lights = make_cube(), make_lights(((0, 0, 0), 1))
    make_cube("other")["vlm_tag"] = 41
    select(cube, lights)
    tagged = assign_tag(CONTEXT, 0)
    assert (tagged.tag, tagged.lights, tagged.objects) == (42, 1, 1)
    assert (cube["vlm_tag"], tags(lights)) == (42, [42])
    assert left_out()[:, :12].all()


def test_an_id_of_links_is_no_unused_one(make_lights):
    write_links(make_lights(((0, 0, 0), 1)), np.array([[3, 77]], np.int32))
    assert unused_tag() == 78


def test_in_edit_mode_the_selected_faces_of_both_get_it(make_cube, make_lights):
    cube, lights = make_cube(), make_lights(((0, 0, 0), 1), ((3, 0, 0), 1))
    edit(cube, 2)
    edit(lights, 1)
    select(cube, lights)
    bpy.ops.object.mode_set(mode="EDIT")
    tagged = assign_tag(CONTEXT, 9)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert (tagged.lights, tagged.faces, tagged.objects) == (1, 1, 0)
    assert (tags(cube), tags(lights)) == ([0, 0, 9, 0, 0, 0], [0, 9])
    assert "vlm_tag" not in cube


def test_faces_follow_an_object_that_is_tagged_unless_others_share_them(make_cube, scene):
    cube = make_cube()
    write_faces(cube, "vlm_tag", np.arange(6))
    twin = cube.copy()
    scene.collection.objects.link(twin)
    select(cube)
    assert assign_tag(CONTEXT, 5).shared == 1
    assert tags(cube) == [0, 1, 2, 3, 4, 5]
    select(cube, twin)
    assert assign_tag(CONTEXT, 5).shared == 0
    assert tags(cube) == [0] * 6


def test_clearing_takes_ids_and_dead_links_away(make_cube, make_lights):
    cube, lights = make_cube(), make_lights(((0, 0, 0), 1), ((3, 0, 0), 1))
    cube["vlm_tag"] = 5
    write_faces(lights, "vlm_tag", np.array([5, 6]))
    write_links(lights, np.array([[5, 6]], np.int32))
    select(cube, lights)
    clear_tag(CONTEXT)
    assert "vlm_tag" not in cube
    assert tags(lights) == [0, 0]
    assert not len(read_links(lights))


def test_a_linked_object_is_refused_before_anything_is_tagged(make_cube, make_lights, tmp_path, scene):
    path = str(tmp_path / "library.blend")
    make_cube("linked")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["linked"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    lights = make_lights(((0, 0, 0), 1), name="a light mesh")
    select(lights, wanted.objects[0])
    assert "make it local" in tag_problem(CONTEXT)
    with pytest.raises(InvalidInput, match="linked from another file"):
        assign_tag(CONTEXT, 3)
    assert tags(lights) == [0]


def stored_state():
    """Attributes and properties of all visible objects, to see that reading leaves no trace."""
    state = {}
    for thing in bpy.data.objects:
        names = [(a.name, a.data_type, a.domain) for a in thing.data.attributes] if thing.type == "MESH" else []
        active = thing.data.attributes.active_index if thing.type == "MESH" else None
        values = tags(thing) if thing.type == "MESH" else None
        state[thing.name] = (
            names,
            active,
            values,
            {name: str(list(value) if name == "vlm_links" else value) for name, value in thing.items()},
        )
    return state


@pytest.mark.parametrize("kind", ["none", "SUBSURF", "MIRROR", "SOLIDIFY", "ARRAY", "BEVEL", "TRIANGULATE"])
def test_triangles_lead_back_to_their_face_through_modifiers(make_cube, kind):
    cube = make_cube()
    write_faces(cube, "vlm_tag", np.array([0, 7, 0, 0, 8, 0]))
    cube["vlm_tag"] = 3
    if kind != "none":
        cube.modifiers.new(kind, kind)
    before = stored_state()
    found = read_source_faces()
    assert stored_state() == before
    (place,) = (place for place in found.places if place.of_mesh)
    (whole,) = (place.first for place in found.places if not place.of_mesh)
    (rows,), (mesh,) = found.rows, found.snapshot.meshes
    # Faces without an id of their own are decided by the object's.
    assert set(rows.tolist()) == {place.first + 1, place.first + 4, whole}
    assert mesh.tag_ids.tolist() == found.tags[rows].tolist()
    normals = np.cross(*(mesh.positions[mesh.triangles[:, k]] - mesh.positions[mesh.triangles[:, 0]] for k in (1, 2)))
    if kind in ("none", "SUBSURF", "ARRAY", "TRIANGULATE"):
        assert (normals[rows == place.first + 1] @ cube.data.polygons[1].normal > 0.0).all()


def test_instances_lead_back_to_the_mesh_that_they_share(make_cube, scene):
    group = bpy.data.collections.new("group")
    cube = make_cube("a/b", collection=group)
    for x in (5.0, 9.0):
        instance = bpy.data.objects.new("instance/of", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", group
        instance.location.x = x
        scene.collection.objects.link(instance)
    bpy.context.view_layer.update()
    found = read_source_faces()
    assert len(found.rows) == 2
    assert np.array_equal(*found.rows)
    assert found.owners[0][0] == cube.name
    assert found.owners[0][1].startswith("instance/of")


def test_text_counts_as_one_face(scene):
    text = bpy.data.objects.new("text", bpy.data.curves.new("text", "FONT"))
    text.data.body = "I"
    scene.collection.objects.link(text)
    bpy.context.view_layer.update()
    found = read_source_faces()
    assert found.as_wholes == ("text",)
    assert len(set(found.rows[0].tolist())) == 1
    assert found.places[found.place_of(found.rows[0][0])].name == "text"


def test_linked_objects_lead_nowhere_and_are_named(make_cube, tmp_path):
    path = str(tmp_path / "library.blend")
    make_cube("linked")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["linked"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.context.view_layer.update()
    found = read_source_faces()
    assert found.read_only == ("linked",)
    assert (found.rows[0] == NO_FACE).all()


def test_paired_faces_leave_out_their_own_lights_and_no_others(make_grid, make_lights):
    make_grid(sides=4)
    lights = make_lights(*(((x, y, -0.1), 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)))
    made, written = run(tag_pairing.pair, lights)
    assert (written.lights, written.faces, written.objects, written.links) == (4, 16, 0, 0)
    assert made.pairs == 16
    out = left_out()
    middles = np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]]).repeat(2, axis=0)
    (mesh,) = extract().snapshot.meshes
    own = (np.abs(middles[:, None] - mesh.positions[mesh.triangles].mean(axis=1)[None, :, :2]) < 0.5).all(axis=2)
    assert np.array_equal(out, own)


def test_a_face_larger_than_its_lights_leaves_out_all_of_them(make_plane, make_lights):
    make_plane("near", size=2.0)
    make_plane("far", size=2.0).location.x = 10.0
    lights = make_lights(*(((x, y, -0.1), 0.25) for y in (-0.5, 0.5) for x in (-0.5, 0.5)))
    run(tag_pairing.pair, lights)
    out = left_out()
    assert out[:, :2].all()
    assert not out[:, 2:].any()


def test_pairing_again_changes_nothing(make_grid, make_lights):
    make_grid(sides=3)
    lights = make_lights(*(((x, 0, -0.1), 0.5) for x in (-0.5, 0.5)))
    run(tag_pairing.pair, lights)
    before = stored_state()
    made, written = run(tag_pairing.pair, lights)
    assert made.pairs == 0
    assert (written.lights, written.faces, written.objects, written.links) == (0, 0, 0, 0)
    assert stored_state() == before


def test_ids_of_lights_that_are_gone_are_forgotten_and_those_of_artists_stay(make_grid, make_lights):
    grid = make_grid(sides=2)
    first = make_lights(((-0.5, 0, -0.1), 1.0), name="first")
    run(tag_pairing.pair, first)
    before = tags(grid)
    write_faces(grid, "vlm_tag", np.array([before[0], before[1], before[2], 7]))
    bpy.data.objects.remove(first)
    second = make_lights(((0.0, 0, -0.1), 1.0), name="second")
    run(tag_pairing.pair, second)
    assert tags(grid)[3] == 7
    assert len(set(tags(grid)[:3])) == 1
    assert left_out().all()


def test_ids_by_hand_are_below_those_of_pairing(make_grid, make_lights):
    make_grid(sides=2)
    run(tag_pairing.pair, make_lights(((0, 0, -0.1), 1.0)))
    assert unused_tag() == 1


def test_ids_by_hand_that_are_used_up_do_not_run_over_into_those_of_pairing(make_cube, make_lights):
    make_cube("last")["vlm_tag"] = FIRST_AUTOMATIC - 3
    assert unused_tag(2) == FIRST_AUTOMATIC - 2
    with pytest.raises(InvalidInput, match="that can be given by hand"):
        unused_tag(3)
    lights, cube = make_lights(((0, 0, 0), 1)), make_cube("cube")
    bpy.data.objects["last"]["vlm_tag"] = FIRST_AUTOMATIC - 1
    select(lights, cube)
    with pytest.raises(InvalidInput, match="that can be given by hand"):
        links.link_receivers(CONTEXT, [cube])
    assert "vlm_tag" not in cube


def copied(scene, *things):
    """Copies of objects with meshes of their own, beside them."""
    copies = []
    for thing in things:
        copy = thing.copy()
        copy.data = thing.data.copy()
        copy.location.x += 10.0
        scene.collection.objects.link(copy)
        copies.append(copy)
    return copies


def test_copies_of_what_an_artist_gave_an_id_get_ids_as_artists_give_them(make_grid, make_lights, scene):
    grid = make_grid(sides=1)
    grid["vlm_tag"] = 12
    lights = make_lights(((0, 0, -0.1), 1.0), sources=["grid"])
    write_faces(lights, "vlm_tag", np.array([12]))
    make_grid("hidden", sides=1)["vlm_tag"] = 40
    bpy.data.objects["hidden"].hide_render = True
    copies = copied(scene, grid, lights)
    copies[1]["vlm_sources"] = ""
    assert run(separate, lights, copies[1])[0].pairs == 1
    assert (grid["vlm_tag"], tags(lights)) == (12, [12])
    assert (copies[0]["vlm_tag"], tags(copies[1])) == (41, [41])


def test_an_id_given_by_hand_goes_to_the_lights(make_grid, make_lights):
    grid = make_grid(sides=2)
    grid["vlm_tag"] = 12
    lights = make_lights(*(((x, 0, -0.1), 0.5) for x in (-0.5, 0.5)))
    run(tag_pairing.pair, lights)
    assert tags(lights) == [12, 12]
    assert grid["vlm_tag"] == 12
    assert tags(grid) == [0, 0, 0, 0]


def test_only_the_sources_are_paired_and_of_these_the_chosen_ones(make_plane, make_lights):
    one, other = make_plane("one"), make_plane("other")
    other.location.z = 0.05
    lights = make_lights(((0, 0, -0.1), 0.9), sources=["one"])
    run(tag_pairing.pair, lights)
    assert (any(tags(one)), any(tags(other))) == (True, False)
    again = make_lights(((0, 0, -0.1), 0.9), name="again")
    run(tag_pairing.pair, again, objects=[other])
    assert tags(other) == tags(again)


def test_both_sides_of_a_thin_shell_are_tagged_and_thick_bodies_are_not(make_mesh, make_grid, make_lights):
    """A sheet that light falls on from below, too, needs tags; the floor of a scene does not."""
    sheet, floor = make_grid("sheet", sides=2), make_grid("floor", sides=1)
    sheet.location.z, floor.location.z, floor.scale = 1.0, -1.0, (3.0, 3.0, 1.0)
    on_sheet = make_lights(((0, 0, 0.99), 1.0), name="on sheet", sources=["sheet"])
    on_floor = make_lights(((0, 0, -1.1), 3.0), name="on floor", sources=["floor"])
    run(tag_pairing.pair_thin, on_sheet, on_floor)
    assert (tags(on_sheet), tags(on_floor)) == ([FIRST_AUTOMATIC], [0])
    assert tags(sheet) == [FIRST_AUTOMATIC] * 4
    assert tags(floor) == [0]


def test_copies_get_ids_of_their_own_with_their_links(make_grid, make_lights, scene):
    grid = make_grid(sides=1)
    lights = make_lights(*(((x, 0, -0.1), 0.5) for x in (-0.5, 0.5)), sources=["grid"])
    run(tag_pairing.pair, lights)
    originals = tags(grid), tags(lights), read_links(lights).tolist()
    assert originals[2], "one face in two regions needs links"
    copies = copied(scene, grid, lights)
    copies[1]["vlm_sources"] = ""
    made, written = run(separate, lights, copies[1])
    assert made.pairs > 0
    assert (tags(grid), tags(lights), read_links(lights).tolist()) == originals
    assert not set(tags(copies[1])) & set(originals[1])
    assert (written.lights, written.faces) == (2, 1)
    # Each still leaves out its own, and lights the copy.
    out = left_out()
    of_copy = np.array([mesh.positions[:, 0].mean() > 5 for mesh in extract().snapshot.meshes]).repeat(2)
    lights_of_copy = extract().light_mesh.corners[:, :, 0].mean(axis=1) > 5
    assert np.array_equal(out, lights_of_copy[:, None] == of_copy[None])
    assert run(separate, lights, copies[1])[0].pairs == 0


def test_what_changed_meanwhile_is_left_alone(make_grid, make_lights):
    grid, lights = make_grid(sides=1), make_lights(((0, 0, -0.1), 1.0))
    bpy.context.view_layer.update()
    made = tag_pairing.pair(tag_pairing.read_tagging(CONTEXT, [lights]), silent)
    bpy.data.objects.remove(grid)
    with pytest.raises(InvalidInput, match="changed while"):
        tag_pairing.write_retagged(CONTEXT, made)
    assert tags(lights) == [0]


@pytest.mark.parametrize(("count", "words"), [(0, ""), (1, "1 light"), (2000, "2,000 lights")])
def test_numbers_are_told_in_words(count, words):
    assert light_tags.counted(count, "light") == words


def test_walls_around_a_light_on_the_floor_are_not_what_it_stands_for(make_cube, scene):
    room = make_cube("Room")
    room.data.flip_normals()
    bpy.context.view_layer.update()
    lights = bpy.data.meshes.new("lights")
    corners = [(x, y, -1.01) for x, y in ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9))]
    lights.from_pydata(corners, [], [(0, 1, 2, 3)])
    thing = bpy.data.objects.new("VLM", lights)
    thing["vlm_schema"] = 2
    scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    tagging = tag_pairing.read_tagging(bpy.context, [thing])
    tag_pairing.write_retagged(bpy.context, tag_pairing.pair(tagging, silent))
    tags = read_faces(room, "vlm_tag")
    floor = np.array([polygon.center.z < -0.9 for polygon in room.data.polygons])
    assert (tags[floor] != 0).all()
    assert not tags[~floor].any()
