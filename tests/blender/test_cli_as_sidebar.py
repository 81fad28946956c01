# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line makes and checks light meshes as the sidebar does, and renders pictures of the same size."""

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking
from vlm_addon.blender.engine import picture_size
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import read_faces, write_faces
from vlm_addon.blender.light_meshes import light_meshes, source_names, sources
from vlm_addon.blender.names import COLOR_ATTRIBUTE, MARK_ATTRIBUTE, TAG_ATTRIBUTE
from vlm_addon.blender.render_commands import with_scene_settings
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.cli import main
from vlm_addon.core.progress import silent
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC
from vlm_addon.render.frame_types import RenderSettings

pytestmark = pytest.mark.usefixtures("_empty_file")


def saved(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return str(path)


def baked(path, tmp_path):
    """The light mesh that the command line makes of a scene."""
    assert main(["bake", str(path), "--triangles", "12", "--save", str(tmp_path / "baked.blend")]) == 0
    open_scene(tmp_path / "baked.blend")
    (found,) = light_meshes(bpy.context.scene)
    return found


def test_lights_of_an_instanced_object_know_what_instances_it(make_cube, tmp_path):
    inner, hidden = make_cube("Inner"), bpy.data.collections.new("hidden")
    bpy.context.scene.collection.children.link(hidden)
    for collection in inner.users_collection:
        collection.objects.unlink(inner)
    hidden.objects.link(inner)
    bpy.context.view_layer.layer_collection.children["hidden"].exclude = True
    instancer = bpy.data.objects.new("Instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", hidden
    bpy.context.scene.collection.objects.link(instancer)
    made = baked(saved(tmp_path / "scene.blend"), tmp_path)
    assert source_names(made) == ["Instancer"]
    assert [source.name for source in sources(made, bpy.context.scene)] == ["Instancer"]


def test_new_lights_carry_no_ids_of_pairing_and_the_marks_of_their_creation(make_cube, tmp_path):
    write_faces(make_cube(), TAG_ATTRIBUTE, np.array([FIRST_AUTOMATIC + 7] * 3 + [5] * 3, np.int32))
    made = baked(saved(tmp_path / "scene.blend"), tmp_path)
    assert set(read_faces(made, TAG_ATTRIBUTE).tolist()) == {0, 5}
    assert read_faces(made, MARK_ATTRIBUTE).any()


def test_a_negative_color_is_the_finding_that_the_sidebar_lists(make_cube, tmp_path, capsys):
    ensure_scene_settings()
    make_cube("Box").select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Box"]
    authoring.write(authoring.from_selection(bpy.context, BakeSettings(target_triangles=12))(silent))
    (made,) = light_meshes(bpy.context.scene)
    colors = read_faces(made, COLOR_ATTRIBUTE)
    colors[0, :3] = -1.0
    write_faces(made, COLOR_ATTRIBUTE, colors)
    path = saved(tmp_path / "scene.blend")
    listed = [str(finding) for finding in checking.check(bpy.context)(silent).findings]
    assert any("negative" in finding for finding in listed)
    capsys.readouterr()
    assert main(["check", path]) == 3
    told = [line.removeprefix("finding: ") for line in capsys.readouterr().out.splitlines() if "finding: " in line]
    assert told == listed


@pytest.mark.parametrize(("percentage", "size"), [(1, (12, 7)), (70, (896, 504)), (100, (1280, 720))])
def test_a_picture_has_the_size_of_f12(percentage, size):
    ensure_scene_settings()
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 1280, 720, percentage
    assert picture_size(bpy.context.scene) == size
    chosen = with_scene_settings(RenderSettings(1, 1, "vlm"), None)
    assert (chosen.width, chosen.height) == size
