# SPDX-License-Identifier: GPL-3.0-or-later
"""Cutting and erasing lights by where they are, and making lights of faces."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.drawing.draw_erase import cut, erase
from vlm_addon.blender.drawing.draw_fill import fill
from vlm_addon.blender.drawing.draw_lights import draw
from vlm_addon.blender.drawing.draw_points import repeated
from vlm_addon.blender.drawing.draw_shapes import rectangle
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.light_faces import face_count, read_faces, select_faces, write_faces
from vlm_addon.blender.write_back import write_light_mesh
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(params=["OBJECT", "EDIT"])
def grid(request, make_plane):
    """A light mesh of 4 x 2 lights of 1 m on a floor, each of its own colour and tag, in object and in edit mode."""
    make_plane(size=10.0)
    points, rings = rectangle(np.zeros(3), np.array([4.0, 2.0, 0.0]), UP, np.array([1.0, 0, 0]), 4, 2)
    draw(bpy.context, points, rings, repeated(UP, 8), 0.0)
    made = bpy.context.object
    colors = np.ones((8, 4), np.float32)
    colors[:, 0] = np.arange(8) + 0.5
    write_faces(made, "vlm_color", colors)
    write_faces(made, "vlm_tag", np.arange(8, dtype=np.int32) + 1)
    bpy.ops.object.mode_set(mode=request.param)
    return made


def tags(thing):
    return read_faces(thing, "vlm_tag").tolist()


def areas_by_tag(thing):
    bpy.ops.object.mode_set(mode="OBJECT")
    lights = extract().light_mesh
    return np.bincount(lights.tag_ids, lights.areas)[1:]


def test_a_cut_parts_the_lights_under_it_and_keeps_what_they_are(grid):
    said = cut(bpy.context, np.array([(0.2, -0.5, 0), (0.2, 2.5, 0)]), repeated(UP, 2))
    assert "Cut 2 times: 10 lights" in said
    assert sorted(tags(grid)) == [1, 1, 2, 3, 4, 5, 5, 6, 7, 8]
    colors = read_faces(grid, "vlm_color")
    assert np.array_equal(colors[:, 0], np.array(tags(grid)) - 0.5)
    assert np.allclose(areas_by_tag(grid), 1.0, rtol=1e-6)


def test_a_cut_goes_no_farther_than_its_ends(grid):
    cut(bpy.context, np.array([(0.2, 0.3, 0), (0.2, 0.6, 0)]), repeated(UP, 2))
    assert sorted(tags(grid)) == [1, 1, 2, 3, 4, 5, 6, 7, 8]


def test_a_way_with_a_corner_cuts_along_both_parts(grid):
    cut(bpy.context, np.array([(0.5, -0.1, 0), (0.5, 0.5, 0), (1.1, 0.5, 0)]), repeated(UP, 3))
    assert (tags(grid).count(1), tags(grid).count(2)) == (3, 2)
    assert np.allclose(areas_by_tag(grid), 1.0, rtol=1e-6)


def test_without_directions_lights_are_cut_straight_through(grid):
    cut(bpy.context, np.array([(0.2, -0.5, 0), (0.2, 2.5, 0)]), np.zeros((2, 3)))
    assert face_count(grid) == 10


@pytest.mark.parametrize("points", [[(20.0, 0, 0), (21, 0, 0)], [(0, 0, 5.0), (4, 2, 5)]])
def test_a_cut_beside_all_lights_is_refused(grid, points):
    with pytest.raises(InvalidInput, match="no unlocked light"):
        cut(bpy.context, np.array(points), repeated(UP, 2))
    assert face_count(grid) == 8


def test_lights_that_face_away_are_not_cut(grid):
    with pytest.raises(InvalidInput, match="no unlocked light"):
        cut(bpy.context, np.array([(0.2, -0.5, 0), (0.2, 2.5, 0)]), repeated(-UP, 2))


def test_erasing_takes_what_is_under_the_brush(grid):
    assert "Erased 2 lights" in erase(bpy.context, np.array([(0.5, 0.5, 0), (1.5, 0.5, 0)]), repeated(UP, 2), 0.1)
    assert tags(grid) == [3, 4, 5, 6, 7, 8]
    assert np.allclose(areas_by_tag(grid)[2:], 1.0, rtol=1e-6)


def test_the_brush_reaches_as_far_as_its_radius(grid):
    erase(bpy.context, np.array([(0.5, 0.5, 0)]), repeated(UP, 1), 0.55)
    assert tags(grid) == [3, 4, 6, 7, 8]


def test_lights_that_face_away_are_not_erased(grid):
    with pytest.raises(InvalidInput, match="no light is under it"):
        erase(bpy.context, np.array([(0.5, 0.5, 0)]), repeated(-UP, 1), 0.1)
    assert face_count(grid) == 8


def test_locked_lights_are_neither_erased_nor_cut(grid):
    write_faces(grid, "vlm_lock", np.array([1, 0, 0, 0, 1, 0, 0, 0], np.int32))
    said = erase(bpy.context, np.array([(1.0, 0.5, 0)]), repeated(UP, 1), 0.1)
    assert "Erased 1 light; 1 locked kept" in said
    with pytest.raises(InvalidInput, match="locked"):
        erase(bpy.context, np.array([(0.5, 0.5, 0)]), repeated(UP, 1), 0.1)
    with pytest.raises(InvalidInput, match="no unlocked light"):
        cut(bpy.context, np.array([(0.2, -0.5, 0), (0.2, 2.5, 0)]), repeated(UP, 2))
    assert tags(grid) == [1, 3, 4, 5, 6, 7, 8]


def test_a_light_deep_under_a_hollow_surface_is_erased_through_it(grid):
    bpy.ops.object.mode_set(mode="OBJECT")
    grid.location.z -= 0.4
    bpy.context.view_layer.update()
    erase(bpy.context, np.array([(0.5, 0.5, 0)]), repeated(UP, 1), 0.01)
    assert tags(grid) == [2, 3, 4, 5, 6, 7, 8]


def test_an_empty_light_mesh_has_nothing_to_erase():
    made = write_light_mesh(empty_light_mesh(), "Empty")
    made.select_set(True)
    with pytest.raises(InvalidInput, match="no light is under it"):
        erase(bpy.context, np.zeros((1, 3)), repeated(UP, 1), 1.0)


def choose_faces(thing, rows, mode):
    select_faces(thing, np.isin(np.arange(len(thing.data.polygons)), rows))
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.object.mode_set(mode=mode)


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_selected_faces_become_lights_of_the_same_polygons(make_cube, make_material, mode):
    red, shader = make_material("red")
    shader.inputs["Base Color"].default_value = (0.6, 0.1, 0.05, 1.0)
    cube = make_cube(material=red)
    cube.data.materials.append(make_material("white")[0])
    cube.data.polygons[2].material_index = 1
    cube.location = (5.0, 0.0, 0.0)
    cube["vlm_tag"] = 9
    bpy.context.view_layer.update()
    choose_faces(cube, [0, 2, 5], mode)
    assert "3 faces" in fill(bpy.context)
    bpy.ops.object.mode_set(mode="OBJECT")
    made = bpy.data.objects["VLM Drawn"]
    assert [len(polygon.vertices) for polygon in made.data.polygons] == [4, 4, 4]
    assert tags(made) == [9, 9, 9]
    (mesh,) = extract_scene().meshes
    assert np.allclose(read_faces(made, "vlm_color")[:, :3], mesh.reflectance[[0, 4, 10]], rtol=1e-6)
    for light, face in zip(made.data.polygons, (0, 2, 5), strict=True):
        source = cube.data.polygons[face]
        assert np.allclose(light.normal, source.normal, atol=1e-6)
        offset = np.array(made.matrix_world @ light.center) - np.array(cube.matrix_world @ source.center)
        assert -1e-2 < offset @ np.array(source.normal) < 0.0


def test_faces_are_filled_as_modifiers_show_them(make_cube):
    cube = make_cube()
    cube.modifiers.new("Subdivision", "SUBSURF").levels = 2
    choose_faces(cube, [3], "OBJECT")
    assert "16 faces" in fill(bpy.context)
    made = bpy.data.objects["VLM Drawn"]
    evaluated = cube.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert max(max(abs(c) for c in (made.matrix_world @ v.co)) for v in made.data.vertices) < 1.0
    assert np.allclose(
        sum(p.area for p in made.data.polygons), sum(p.area for p in evaluated.polygons if p.select), rtol=0.05
    )


def test_a_mirrored_object_gives_lights_that_face_outwards(make_cube):
    cube = make_cube()
    cube.scale = (-1.0, 2.0, 1.0)
    bpy.context.view_layer.update()
    choose_faces(cube, range(6), "OBJECT")
    fill(bpy.context)
    lights = extract().light_mesh
    assert (np.einsum("ij,ij->i", lights.area_vectors, lights.corners.mean(axis=1)) > 0.0).all()


def test_filling_again_adds_to_the_light_mesh_of_the_object(make_cube):
    cube = make_cube()
    choose_faces(cube, [0], "EDIT")
    fill(bpy.context)
    assert bpy.context.mode == "OBJECT", "undo in edit mode would leave the lights"
    for thing in bpy.context.selected_objects:
        thing.select_set(False)
    choose_faces(cube, [1], "EDIT")
    fill(bpy.context)
    assert [thing.name for thing in bpy.data.objects if "vlm_schema" in thing] == ["VLM Drawn"]
    assert len(bpy.data.objects["VLM Drawn"].data.polygons) == 2


def test_ids_that_pairing_gave_stay_with_the_lights_that_were_paired(make_cube):
    cube = make_cube()
    cube["vlm_tag"] = FIRST_AUTOMATIC + 1
    write_faces(cube, "vlm_tag", np.array([FIRST_AUTOMATIC, 4, 0, 0, 0, 0], np.int32))
    choose_faces(cube, [0, 1, 2], "OBJECT")
    fill(bpy.context)
    assert tags(bpy.data.objects["VLM Drawn"]) == [0, 4, 0]


@pytest.mark.parametrize(("change", "told"), [("scale", "scale is zero"), ("version", "with the version")])
def test_a_light_mesh_of_the_object_that_can_take_no_lights_is_refused(make_cube, change, told):
    cube = make_cube()
    choose_faces(cube, [0], "OBJECT")
    fill(bpy.context)
    made = bpy.data.objects["VLM Drawn"]
    if change == "scale":
        made.scale.z = 0.0
    else:
        made["vlm_schema"] = 99
    bpy.context.view_layer.update()
    made.select_set(False)
    bpy.context.view_layer.objects.active = cube
    choose_faces(cube, [1], "OBJECT")
    with pytest.raises(InvalidInput, match=told):
        fill(bpy.context)
    assert face_count(made) == 1


def test_no_face_selected_is_refused(make_cube):
    choose_faces(make_cube(), [], "OBJECT")
    with pytest.raises(InvalidInput, match="no face"):
        fill(bpy.context)
    assert "VLM Drawn" not in bpy.data.objects
