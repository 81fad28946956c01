# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes made anew around locked cube_lights."""

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, create_again
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import read_faces, write_faces
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.progress import silent
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC

ensure_scene_settings()


def again(settings=None):
    return authoring.write(create_again.again(bpy.context, settings or BakeSettings(), False)(silent))


def faces_at(thing, axis, side):
    """Faces of the side of the cube that faces along `axis`."""
    return np.array([polygon.normal[axis] * side > 0.9 for polygon in thing.data.polygons])


def test_locked_lights_stay_and_the_rest_is_made_anew(cube_lights):
    top = faces_at(cube_lights, 2, 1.0)
    colors = read_faces(cube_lights, "vlm_color")
    colors[:, :3] = (0.1, 0.2, 7.5)
    write_faces(cube_lights, "vlm_color", colors)
    write_faces(cube_lights, "vlm_lock", top)
    corners = extract().light_mesh.corners[top]
    cube_lights["vlm_strength"], cube_lights["vlm_hue"] = 3.0, (1.0, 0.5, 1.0)
    again()
    locked = read_faces(cube_lights, "vlm_lock") != 0
    assert locked.sum() == 2
    assert np.array_equal(locked, faces_at(cube_lights, 2, 1.0))
    kept = read_faces(cube_lights, "vlm_color")[:, :3]
    assert kept[locked] == pytest.approx(np.tile(np.float32((0.1, 0.2, 7.5)), (2, 1)))
    assert (kept[~locked, 2] < 1.0).all()
    assert (cube_lights["vlm_strength"], *cube_lights["vlm_hue"]) == (3.0, 1.0, 0.5, 1.0)
    assert extract().light_mesh.corners[locked] == pytest.approx(corners, abs=1e-6)


def test_no_light_stands_twice_for_the_surface_of_a_locked_one(cube_lights):
    area = extract().light_mesh.areas.sum()
    write_faces(cube_lights, "vlm_lock", faces_at(cube_lights, 0, -1.0))
    again()
    assert extract().light_mesh.areas.sum() == pytest.approx(area, rel=1e-3)


def test_without_locks_it_is_the_same_again(cube_lights):
    before = extract().light_mesh
    again()
    after = extract().light_mesh
    assert np.array_equal(after.vertices, before.vertices)
    assert np.array_equal(after.colour, before.colour)


def test_a_light_mesh_with_tags_by_pairing_is_tagged_again(cube_lights):
    authoring.write(authoring.from_scene(bpy.context, BakeSettings(), True)(silent))
    before = set(read_faces(cube_lights, "vlm_tag").tolist())
    assert min(before) >= FIRST_AUTOMATIC
    again()
    assert min(read_faces(cube_lights, "vlm_tag").tolist()) >= FIRST_AUTOMATIC


def test_more_locked_lights_than_are_asked_for_is_refused_and_changes_nothing(cube_lights):
    write_faces(cube_lights, "vlm_lock", np.ones(12))
    with pytest.raises(InvalidInput, match="12 of its lights are locked, 8 are asked for"):
        again(BakeSettings(target_triangles=8))
    assert len(cube_lights.data.polygons) == 12


def test_a_renamed_source_is_found(cube_lights):
    bpy.data.objects["Cube"].name = "Crate"
    assert create_again.again_problem(bpy.context) is None
    assert again().startswith("Made 12 virtual lights")


def test_what_cannot_be_made_again_says_why(cube_lights, make_plane):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    told = "All that VLM was made from is gone: undo, or create another light mesh"
    assert create_again.again_problem(bpy.context) == told
    bpy.context.view_layer.objects.active = make_plane()
    assert create_again.again_problem(bpy.context) == "Select the light mesh that is to be made again"


def test_a_light_mesh_copied_with_its_source_is_made_again_of_the_copy(cube_lights):
    cube = bpy.data.objects["Cube"]
    for each in bpy.context.view_layer.objects:
        each.select_set(each in (cube, cube_lights))
    bpy.ops.object.duplicate()
    copies = [each for each in bpy.context.selected_objects if each not in (cube, cube_lights)]
    for each in copies:
        each.location.x += 10.0
    bpy.context.view_layer.objects.active = next(each for each in copies if "vlm_schema" in each)
    bpy.context.view_layer.update()
    again()
    assert bpy.context.view_layer.objects.active.location.x == pytest.approx(10.0)
    assert cube_lights.location.x == pytest.approx(0.0)
