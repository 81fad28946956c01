# SPDX-License-Identifier: GPL-3.0-or-later
"""One-click fixes of what the check finds, written into light meshes of the open file."""

import bmesh
import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking, light_repair
from vlm_addon.blender.drawing import draw_lights
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.findings import fixable_kinds, marked_faces, select_offenders
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import read_faces, write_faces
from vlm_addon.blender.light_meshes import light_meshes
from vlm_addon.blender.light_repair import kinds_to_fix, work_after, work_on, write_fixed
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.progress import silent

ensure_scene_settings()


def check():
    """Kinds of what the check finds, as the scene keeps them."""
    checking.list_checked(checking.check(bpy.context)(silent))
    return [item.kind for item in bpy.context.scene.vlm.findings if item.kind]


def fix(kind=""):
    """All steps of one fix; returns the sentences."""
    told = []
    for each in kinds_to_fix(bpy.context.scene, kind):
        work = work_on(bpy.context, each)
        while work is not None:
            made = work(silent)
            told.append(write_fixed(bpy.context, made))
            work = work_after(bpy.context, made)
    return told


def spoil(thing, name, row, value):
    values = read_faces(thing, name)
    values[row] = value
    write_faces(thing, name, values)


def middle(thing, face):
    return np.array(thing.matrix_world @ thing.data.polygons[face].center)


def test_a_sound_light_mesh_has_nothing_to_fix(cube_lights):
    assert check() == []
    with pytest.raises(InvalidInput, match="none of them can be fixed"):
        fix()


@pytest.mark.parametrize(("value", "kind"), [(np.nan, kinds.NOT_FINITE), (np.inf, kinds.NOT_FINITE)])
def test_values_that_are_no_numbers_become_black(cube_lights, value, kind):
    before = read_faces(cube_lights, "vlm_color")
    spoil(cube_lights, "vlm_color", 4, value)
    assert kind in check()
    assert marked_faces(bpy.context.scene, bpy.context.scene.vlm.findings[0])["VLM"].tolist() == [4]
    fix()
    after = read_faces(cube_lights, "vlm_color")
    assert after[4, :3].tolist() == [0.0, 0.0, 0.0]
    assert np.array_equal(np.delete(after, 4, axis=0), np.delete(before, 4, axis=0))
    assert check() == []


def test_negative_colours_and_factors_become_zero(cube_lights):
    spoil(cube_lights, "vlm_color", 2, -1.0)
    cube_lights["vlm_hue"] = (1.0, -2.0, 1.0)
    assert kinds.NEGATIVE in check()
    fix(kinds.NEGATIVE)
    assert read_faces(cube_lights, "vlm_color")[2, :3].tolist() == [0.0, 0.0, 0.0]
    assert list(cube_lights["vlm_hue"]) == [1.0, 0.0, 1.0]


def test_a_light_that_was_turned_over_is_turned_back(cube_lights):
    normal = np.array(cube_lights.data.polygons[7].normal)
    cube_lights.data.polygons[7].flip()
    cube_lights.data.update()
    found = check()
    assert {kinds.NON_MANIFOLD, kinds.INSIDE_OUT} & set(found)
    fix()
    assert np.array(cube_lights.data.polygons[7].normal) == pytest.approx(normal)
    assert check() == []


def test_a_light_in_front_is_pushed_behind_with_its_power(cube_lights):
    power = area_times_scale(cube_lights)
    for vertex in cube_lights.data.vertices:
        vertex.co *= 1.05
    cube_lights.data.update()
    assert kinds.IN_FRONT in check()
    fix(kinds.IN_FRONT)
    assert check() == []
    places = np.array([cube_lights.matrix_world @ vertex.co for vertex in cube_lights.data.vertices])
    assert np.abs(places).max() < 1.0
    assert area_times_scale(cube_lights) == pytest.approx(1.05**2 * power, rel=1e-5)


def test_a_quad_above_one_large_face_comes_down_flat(make_plane):
    """Two triangles of floor under two of light: each light has its own part of both."""
    make_plane("floor", size=4.0)
    bpy.context.view_layer.update()
    points, normal = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0.0, 0.0, 1.0]])
    draw_lights.draw(bpy.context, points, [[0, 1, 2, 3]], normal, 0.0)
    thing = bpy.data.objects["VLM Drawn"]
    for vertex in thing.data.vertices:
        vertex.co.z += 0.1
    assert check() == [kinds.IN_FRONT]
    assert fix() == ["Moved 2 lights behind the surface"]
    heights = [(thing.matrix_world @ vertex.co).z for vertex in thing.data.vertices]
    assert len(set(heights)) == 1
    assert -1e-5 < heights[0] < 0.0
    assert not read_faces(thing, "vlm_tag").any()
    assert check() == []


def test_lights_of_a_room_that_stand_far_in_front_take_one_press(sample_folder):
    bpy.ops.wm.open_mainfile(filepath=str(sample_folder / "cornell_box.blend"))
    for thing in light_meshes(bpy.context.scene):
        bpy.data.objects.remove(thing)
    authoring.write(authoring.from_scene(bpy.context, BakeSettings(target_triangles=60))(silent))
    (thing,) = light_meshes(bpy.context.scene)
    inwards = [0.1 * vertex.normal for vertex in thing.data.vertices]
    for vertex, way in zip(thing.data.vertices, inwards, strict=True):
        vertex.co += way
    assert kinds.IN_FRONT in check()
    fix(kinds.IN_FRONT)
    assert kinds.IN_FRONT not in check()
    before = [vertex.co.copy() for vertex in thing.data.vertices]
    assert fix(kinds.IN_FRONT) == ["nothing is in front any more"]
    assert [vertex.co for vertex in thing.data.vertices] == before


def area_times_scale(thing):
    areas = np.array([polygon.area for polygon in thing.data.polygons])
    return float(areas @ read_faces(thing, "vlm_area_scale"))


def test_fixing_in_edit_mode_ends_there(cube_lights):
    spoil(cube_lights, "vlm_color", 0, -1.0)
    bpy.ops.object.mode_set(mode="EDIT")
    assert kinds.NEGATIVE in check()
    fix()
    assert bpy.context.mode == "EDIT_MESH"
    assert read_faces(cube_lights, "vlm_color")[0, :3].tolist() == [0.0, 0.0, 0.0]


def test_what_an_artist_may_have_meant_has_its_own_button_alone(cube_lights):
    spoil(cube_lights, "vlm_color", 3, (4.0, 2.0, 1.0, 1.0))
    assert check() == [kinds.BRIGHT]
    assert fixable_kinds(bpy.context.scene) == []
    fix(kinds.BRIGHT)
    assert read_faces(cube_lights, "vlm_color")[3, :3] == pytest.approx([1.0, 0.5, 0.25], rel=1e-6)


def test_a_tag_without_a_surface_is_cleared(cube_lights):
    spoil(cube_lights, "vlm_tag", 5, 77)
    assert check() == [kinds.LOST_TAG]
    fix()
    assert not read_faces(cube_lights, "vlm_tag").any()


def test_lights_without_area_are_deleted(cube_lights):
    first = cube_lights.data.polygons[0].vertices
    moved = cube_lights.data.vertices[first[0]].co.copy()
    cube_lights.data.vertices[first[1]].co = moved
    cube_lights.data.update()
    assert kinds.DEGENERATE in check()
    count = sum(polygon.area < 1e-12 for polygon in cube_lights.data.polygons)
    fix(kinds.DEGENERATE)
    assert len(cube_lights.data.polygons) == 12 - count
    assert kinds.DEGENERATE not in check()


def test_a_sheet_seen_from_both_sides_gets_tags_by_which_it_leaves_its_lights_out(make_plane):
    sheet = make_plane("sheet", size=1.0)
    sheet.location.z = 1.0
    floor = make_plane("floor", size=4.0)
    bpy.context.view_layer.update()
    authoring.write(authoring.from_scene(bpy.context, BakeSettings())(silent))
    thing = bpy.data.objects["VLM"]
    assert check() == [kinds.TWO_SIDED]
    fix()
    over = np.array([middle(thing, face)[2] > 0.5 for face in range(len(thing.data.polygons))])
    tags = read_faces(thing, "vlm_tag")
    assert (tags[over] > 0).all()
    assert not tags[~over].any()
    (tag,) = read_faces(sheet, "vlm_tag").tolist()
    assert leaves_out(extract().light_mesh.links, tags, tag).tolist() == over.tolist()
    assert not read_faces(floor, "vlm_tag").any()
    assert check() == []


def test_a_deformed_light_mesh_is_not_moved_and_said_to_be(cube_lights):
    for vertex in cube_lights.data.vertices:
        vertex.co *= 1.05
    cube_lights.modifiers.new("Cast", "CAST").factor = 0.0
    before = [vertex.co.copy() for vertex in cube_lights.data.vertices]
    assert kinds.IN_FRONT in check()
    (told,) = fix(kinds.IN_FRONT)
    assert "left out 'VLM', which modifiers or shape keys deform" in told
    assert [vertex.co for vertex in cube_lights.data.vertices] == before


def test_a_mesh_of_another_file_is_left_alone_and_said_to_be(cube_lights, tmp_path):
    spoil(cube_lights, "vlm_color", 3, (4.0, 2.0, 1.0, 1.0))
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {cube_lights.data})
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.meshes = [cube_lights.data.name]
    cube_lights.data = wanted.meshes[0]
    assert check() == [kinds.BRIGHT]
    (told,) = fix(kinds.BRIGHT)
    assert "left out 'VLM'" in told
    assert read_faces(cube_lights, "vlm_color")[3, :3].tolist() == [4.0, 2.0, 1.0]


def without_a_face(thing, face=0):
    """What an artist may do while work goes on."""
    edited = bmesh.new()
    edited.from_mesh(thing.data)
    edited.faces.ensure_lookup_table()
    bmesh.ops.delete(edited, geom=[edited.faces[face]], context="FACES")
    edited.to_mesh(thing.data)
    edited.free()


def without_it(thing):
    bpy.data.objects.remove(thing)


@pytest.mark.parametrize("change", [without_a_face, without_it])
def test_what_was_changed_while_a_fix_was_worked_out_is_to_be_fixed_again(cube_lights, change):
    spoil(cube_lights, "vlm_color", 11, 4.0)
    before = read_faces(cube_lights, "vlm_color")[1:]
    made = work_on(bpy.context, kinds.BRIGHT)(silent)
    change(cube_lights)
    with pytest.raises(InvalidInput, match=r"'VLM'.*changed while its lights were judged; fix it again"):
        write_fixed(bpy.context, made)
    if bpy.data.objects.get("VLM") is not None:
        assert np.array_equal(read_faces(cube_lights, "vlm_color"), before)


def test_what_was_changed_before_its_lights_are_paired_is_to_be_fixed_again(make_plane):
    make_plane("sheet", size=1.0).location.z = 1.0
    make_plane("floor", size=4.0)
    bpy.context.view_layer.update()
    authoring.write(authoring.from_scene(bpy.context, BakeSettings())(silent))
    thing = bpy.data.objects["VLM"]
    made = work_on(bpy.context, kinds.TWO_SIDED)(silent)
    assert write_fixed(bpy.context, made) == ""
    without_a_face(thing)
    with pytest.raises(InvalidInput, match="changed while its lights were judged"):
        work_after(bpy.context, made)
    assert not read_faces(thing, "vlm_tag").any()


def test_a_fix_reads_in_the_window_and_looks_in_the_background(cube_lights, monkeypatch):
    judged = []
    check_light_mesh = light_repair.check_light_mesh
    monkeypatch.setattr(light_repair, "check_light_mesh", lambda *a, **k: judged.append(1) or check_light_mesh(*a, **k))
    for kind in (kinds.THIN, kinds.TWO_SIDED, kinds.IN_FRONT):
        work = work_on(bpy.context, kind)
        assert not judged
        work(silent)
        assert judged.pop()


@pytest.mark.parametrize("change", [without_a_face, without_it])
def test_a_check_of_what_was_changed_meanwhile_is_listed_but_selects_nothing(cube_lights, change):
    spoil(cube_lights, "vlm_color", 11, 4.0)
    made = checking.check(bpy.context)(silent)
    change(cube_lights)
    checking.list_checked(made)
    (finding,) = bpy.context.scene.vlm.findings
    assert finding.kind == kinds.BRIGHT
    with pytest.raises(InvalidInput, match=r"12 when it was checked|gone or was renamed since the check"):
        select_offenders(bpy.context, 0)


def instanced_at(things, x):
    """Put objects into a collection that is shown by an instance at (x, 0, 0) alone."""
    collection = bpy.data.collections.new("set")
    bpy.context.scene.collection.children.link(collection)
    for thing in things:
        for each in list(thing.users_collection):
            each.objects.unlink(thing)
        collection.objects.link(thing)
    bpy.context.view_layer.layer_collection.children["set"].exclude = True
    instancer = bpy.data.objects.new("instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
    instancer.location.x = x
    bpy.context.scene.collection.objects.link(instancer)
    bpy.context.view_layer.update()


def test_an_instance_of_a_light_mesh_is_not_moved_and_said_to_be(cube_lights):
    for vertex in cube_lights.data.vertices:
        vertex.co *= 1.1
    cube_lights.data.update()
    instanced_at([bpy.data.objects["Cube"], cube_lights], 10.0)
    before = [vertex.co.copy() for vertex in cube_lights.data.vertices]
    assert kinds.IN_FRONT in check()
    (told,) = fix(kinds.IN_FRONT)
    assert "left out 'VLM', which instances show elsewhere" in told
    assert [vertex.co for vertex in cube_lights.data.vertices] == before


def test_colours_of_an_instance_are_mended(cube_lights):
    spoil(cube_lights, "vlm_color", 3, (4.0, 2.0, 1.0, 1.0))
    instanced_at([bpy.data.objects["Cube"], cube_lights], 10.0)
    assert check() == [kinds.BRIGHT]
    (told,) = fix(kinds.BRIGHT)
    assert "left out" not in told
    assert read_faces(cube_lights, "vlm_color")[3, :3] == pytest.approx([1.0, 0.5, 0.25], rel=1e-6)


def test_a_mesh_that_two_light_meshes_share_is_mended_once(cube_lights):
    twin = cube_lights.copy()
    bpy.context.scene.collection.objects.link(twin)
    spoil(cube_lights, "vlm_color", 3, (4.0, 2.0, 1.0, 1.0))
    assert kinds.BRIGHT in check()
    (told,) = fix(kinds.BRIGHT)
    assert "left out" not in told
    assert read_faces(twin, "vlm_color")[3, :3] == pytest.approx([1.0, 0.5, 0.25], rel=1e-6)
    for vertex in twin.data.vertices:
        vertex.co *= 1.05
    twin.data.update()
    (told,) = fix(kinds.IN_FRONT)
    assert "; left out 'VLM.001', whose mesh another light mesh has, too" in told


def test_offenders_are_selected_in_edit_mode(cube_lights):
    spoil(cube_lights, "vlm_color", 3, 4.0)
    spoil(cube_lights, "vlm_color", 8, 4.0)
    check()
    assert select_offenders(bpy.context, 0) == 2
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [polygon.index for polygon in cube_lights.data.polygons if polygon.select] == [3, 8]


def test_a_light_mesh_that_has_changed_since_is_to_be_checked_again(cube_lights):
    spoil(cube_lights, "vlm_color", 3, 4.0)
    check()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    with pytest.raises(InvalidInput, match="it has 48 faces and had 12 when it was checked; run Check again"):
        select_offenders(bpy.context, 0)


def test_a_finding_that_is_not_there_is_named():
    with pytest.raises(InvalidInput, match="there is no finding 3, the last check has 0"):
        select_offenders(bpy.context, 3)
