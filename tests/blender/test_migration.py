# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the first schema are brought up to date when they are opened; later ones and linked ones are let be."""

import shutil
from contextlib import ExitStack

import bpy
import numpy as np
import pytest

from vlm_addon.blender import migration
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import write_faces
from vlm_addon.blender.light_meshes import require_editable, sources
from vlm_addon.core.errors import InvalidInput

FIRST, PRESENT, LATER = 1, 2, 3


@pytest.fixture(autouse=True)
def _migrating():
    ensure_scene_settings()
    with ExitStack() as undo:
        migration.register(undo)
        yield


@pytest.fixture
def make_old(make_plane, make_cube):
    """make_old(schema): a light mesh as version 0.1 wrote it, of the objects Wall and Cube."""

    def make(schema=FIRST):
        for name in ("Wall", "Cube"):
            make_cube(name)
        lights = make_plane("VLM Wall")
        write_faces(lights, "vlm_color", np.array([[0.5, 0.25, 7.5, 1.0]]))
        write_faces(lights, "vlm_tag", np.array([3]))
        lights["vlm_schema"] = schema
        lights["vlm_strength"] = 2.0
        lights["vlm_sources"] = "Wall\nCube"
        return lights

    return make


@pytest.fixture
def reopen(tmp_path):
    """reopen(): save the file and open it."""

    def save_and_open():
        path = str(tmp_path / "old.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        return path

    return save_and_open


def test_a_light_mesh_of_the_first_schema_is_of_the_present_one_once_opened(make_old, reopen):
    make_old()
    reopen()
    assert bpy.data.objects["VLM Wall"]["vlm_schema"] == PRESENT


def test_its_sources_are_found_after_they_are_renamed(make_old, reopen, scene):
    make_old()
    reopen()
    wall, cube = bpy.data.objects["Wall"], bpy.data.objects["Cube"]
    wall.name, cube.name = "elsewhere", "Wall"
    assert sources(bpy.data.objects["VLM Wall"], bpy.context.scene) == [wall, cube]


def test_its_lights_are_the_same_as_before(make_old, reopen):
    make_old()
    before = extract().light_mesh
    reopen()
    after = extract().light_mesh
    for field in ("vertices", "triangles", "colour", "emission", "strength", "tag_ids"):
        assert np.array_equal(getattr(after, field), getattr(before, field)), field


def test_opening_a_migrated_file_again_changes_nothing(make_old, reopen):
    make_old()
    reopen()
    ids = [thing.get("vlm_id") for thing in bpy.data.objects]
    reopen()
    assert [thing.get("vlm_id") for thing in bpy.data.objects] == ids
    assert migration.migrate_file() == 0


def test_all_scenes_of_a_file_are_migrated(make_old, reopen):
    lights = make_old()
    bpy.data.scenes.new("other").collection.objects.link(lights)
    bpy.context.scene.collection.objects.unlink(lights)
    reopen()
    assert bpy.data.objects["VLM Wall"]["vlm_schema"] == PRESENT


def test_a_source_that_is_gone_does_not_stop_it(make_old, reopen):
    lights = make_old()
    bpy.data.objects.remove(bpy.data.objects["Wall"])
    reopen()
    lights = bpy.data.objects["VLM Wall"]
    assert lights["vlm_schema"] == PRESENT
    assert sources(lights, bpy.context.scene) == [None, bpy.data.objects["Cube"]]


def test_a_light_mesh_drawn_by_hand_is_migrated_too(make_old, reopen):
    del make_old()["vlm_sources"]
    reopen()
    lights = bpy.data.objects["VLM Wall"]
    assert (lights["vlm_schema"], sources(lights, bpy.context.scene)) == (PRESENT, [])


def test_one_of_a_later_version_is_let_be_and_refused(make_old, reopen):
    make_old(LATER)
    reopen()
    lights = bpy.data.objects["VLM Wall"]
    assert lights["vlm_schema"] == LATER
    with pytest.raises(InvalidInput, match="is 3, not"):
        require_editable(lights)
    with pytest.raises(InvalidInput, match="is 3, not"):
        extract()


def test_a_linked_one_of_the_first_schema_is_read_as_it_is(make_old, reopen):
    make_old()
    path = reopen_as_library(reopen)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["VLM Wall"]
    (lights,) = wanted.objects
    bpy.context.scene.collection.objects.link(lights)
    assert migration.migrate_file() == 0
    assert lights["vlm_schema"] == FIRST
    assert np.array_equal(extract().light_mesh.tag_ids, [3, 3])
    with pytest.raises(InvalidInput, match="linked from another file"):
        require_editable(lights)


def test_an_appended_one_of_the_first_schema_is_migrated_once_the_file_is_opened_again(make_old, reopen):
    make_old()
    path = reopen_as_library(reopen)
    with bpy.data.libraries.load(path, link=False) as (_, wanted):
        wanted.objects = ["VLM Wall", "Wall", "Cube"]
    for thing in wanted.objects:
        bpy.context.scene.collection.objects.link(thing)
    require_editable(bpy.data.objects["VLM Wall"])
    reopen()
    assert bpy.data.objects["VLM Wall"]["vlm_schema"] == PRESENT


def reopen_as_library(reopen):
    """Path of the file as it was written, before any migration; the open file is empty afterwards."""
    with_handlers = list(bpy.app.handlers.load_post)
    bpy.app.handlers.load_post.clear()
    path = reopen()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.app.handlers.load_post.extend(with_handlers)
    library = path.replace("old.blend", "library.blend")
    return shutil.move(path, library)
