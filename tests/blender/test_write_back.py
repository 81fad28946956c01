# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes written into a file are those that are read from it, and replace each other cleanly."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.write_back import write_light_mesh
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh, empty_light_mesh

NAME = "Virtual Light Mesh"


@pytest.fixture
def light_mesh():
    """Three lights of different values, away from the origin."""
    generator = np.random.default_rng(3)
    return VirtualLightMesh(
        vertices=generator.random((5, 3)) + np.array([100.0, -50.0, 7.0]),
        triangles=np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]], np.int32),
        colour=generator.random((3, 3)).astype(np.float32) * np.float32(7.5),
        emission=generator.random((3, 3)).astype(np.float32),
        strength=np.array([1.0, 1.5, 0.25], np.float32),
        tag_ids=np.array([0, 3, 900000], np.int32),
        dynamic=np.zeros(3, bool),
        samples=SourceSamples(
            np.zeros((3, 3)), np.zeros((3, 3), np.float32), np.ones(3, np.float32), np.arange(4, dtype=np.int32)
        ),
    )


def counts():
    return {name: len(getattr(bpy.data, name)) for name in ("objects", "meshes", "collections")}


def test_what_is_written_is_what_is_read(light_mesh):
    write_light_mesh(light_mesh, NAME)
    found = extract().light_mesh
    for field in ("triangles", "colour", "emission", "strength", "tag_ids", "dynamic"):
        assert np.array_equal(getattr(found, field), getattr(light_mesh, field)), field
    # Coordinates are float32 around the middle of the mesh, far better than float32 in the world.
    assert np.abs(found.vertices - light_mesh.vertices).max() < 1e-7


def test_it_survives_saving_and_loading(light_mesh, tmp_path):
    write_light_mesh(light_mesh, NAME, ["floor", "wall"])
    before = extract().light_mesh
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    after = extract().light_mesh
    for field in ("vertices", "triangles", "colour", "emission", "strength", "tag_ids"):
        assert np.array_equal(getattr(after, field), getattr(before, field)), field
    assert bpy.data.objects[NAME]["vlm_sources"].split("\n") == ["floor", "wall"]


def test_the_object_is_as_the_table_says(light_mesh):
    made = write_light_mesh(light_mesh, NAME)
    assert made["vlm_schema"] == 2
    assert (made["vlm_strength"], tuple(made["vlm_hue"]), made["vlm_dynamic"]) == (1.0, (1.0, 1.0, 1.0), False)
    assert (made.hide_render, made.display_type) == (True, "WIRE")
    assert [collection.name for collection in made.users_collection] == ["Virtual Light Meshes"]
    kinds = {a.name: (a.data_type, a.domain) for a in made.data.attributes if a.name.startswith("vlm_")}
    assert kinds == {
        "vlm_color": ("FLOAT_COLOR", "FACE"),
        "vlm_emission": ("FLOAT_COLOR", "FACE"),
        "vlm_tag": ("INT", "FACE"),
        "vlm_area_scale": ("FLOAT", "FACE"),
    }
    assert not made.data.validate()


def test_writing_again_replaces_and_leaves_no_orphans(light_mesh):
    first = write_light_mesh(light_mesh, NAME)
    first["vlm_strength"] = 2.0
    before, name = counts(), first.data.name
    second = write_light_mesh(light_mesh, NAME)
    assert (second.name, second.data.name) == (NAME, name)
    assert counts() == before
    assert second["vlm_strength"] == 2.0


def test_a_moved_light_mesh_is_back_in_place_when_replaced(light_mesh):
    made = write_light_mesh(light_mesh, NAME)
    made.location.x += 10.0
    made.scale = (2.0, 2.0, 2.0)
    write_light_mesh(light_mesh, NAME)
    assert np.abs(extract().light_mesh.vertices - light_mesh.vertices).max() < 1e-7


def test_an_ordinary_object_of_that_name_is_left_alone(light_mesh, make_cube):
    cube = make_cube(NAME)
    made = write_light_mesh(light_mesh, NAME)
    assert made != cube
    assert len(cube.data.polygons) == 6


def test_a_mesh_that_others_use_stays(light_mesh, scene):
    first = write_light_mesh(light_mesh, NAME)
    copy = first.copy()
    scene.collection.objects.link(copy)
    write_light_mesh(light_mesh, NAME)
    assert len(copy.data.polygons) == 3


def test_two_light_meshes_share_the_collection(light_mesh):
    for name in ("a", "b"):
        write_light_mesh(light_mesh, name)
    assert len(bpy.data.collections["Virtual Light Meshes"].objects) == 2


def test_another_scene_has_its_own_collection(light_mesh):
    write_light_mesh(light_mesh, NAME)
    other = bpy.data.scenes.new("other")
    made = write_light_mesh(light_mesh, NAME, scene=other)
    assert made.name in other.objects
    assert len(bpy.context.scene.objects) == 1


def test_dynamic_lights_make_a_dynamic_object(light_mesh):
    from dataclasses import replace

    made = write_light_mesh(replace(light_mesh, dynamic=np.array([False, True, False])), NAME)
    assert made["vlm_dynamic"] is True


def test_no_lights_make_an_empty_object():
    made = write_light_mesh(empty_light_mesh(), NAME)
    assert len(made.data.polygons) == 0


def test_lights_that_cannot_be_are_refused_and_nothing_is_made(light_mesh):
    from dataclasses import replace

    before = counts()
    with pytest.raises(InvalidInput, match="negative"):
        write_light_mesh(replace(light_mesh, colour=-light_mesh.colour), NAME)
    assert counts() == before


def test_a_light_mesh_in_edit_mode_is_refused(light_mesh):
    made = write_light_mesh(light_mesh, NAME)
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(InvalidInput, match="being edited"):
        write_light_mesh(light_mesh, NAME)


def test_a_linked_light_mesh_is_refused(light_mesh, tmp_path, scene):
    path = str(tmp_path / "library.blend")
    write_light_mesh(light_mesh, NAME)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = [NAME]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    with pytest.raises(InvalidInput, match="linked from another file"):
        write_light_mesh(light_mesh, NAME)
