# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes that are created with tags: each face leaves out the lights that the simplification maps it to."""

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_faces import read_faces
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.progress import silent
from vlm_addon.core.simplify import create_light_mesh

SETTINGS = BakeSettings(target_triangles=40)


@pytest.fixture
def things(make_cube, make_mesh):
    """A cube of quads, one that a modifier rounds, and one that two objects share."""
    ensure_scene_settings()
    plain, rounded, shared = make_cube("plain"), make_cube("rounded"), make_cube("shared")
    rounded.modifiers.new("subdivision", "SUBSURF").render_levels = 2
    twin = shared.copy()
    twin.name = "twin"
    bpy.context.scene.collection.objects.link(twin)
    for number, thing in enumerate((plain, rounded, shared, twin)):
        thing.location.x = 5.0 * number
    bpy.context.view_layer.update()
    return plain, rounded, shared, twin


def create(settings=SETTINGS):
    made = authoring.from_scene(bpy.context, settings, tag_regions=True)(silent)
    authoring.write(made)
    bpy.context.view_layer.update()
    return made


def test_each_face_leaves_out_the_lights_of_its_triangles_and_no_others(things):
    mapped = create_light_mesh(extract_scene().meshes, SETTINGS).light_of_triangle
    create()
    found = extract()
    tags = np.concatenate([mesh.tag_ids for mesh in found.snapshot.meshes])
    out = leaves_out(found.light_mesh.links, found.light_mesh.tag_ids[None], tags[:, None])
    own = np.concatenate(mapped)
    # Faces of one tag have the same lights; whose triangles these are is the oracle of what they are.
    for tag in np.unique(tags):
        assert set(np.flatnonzero(out[tags == tag][0])) == set(own[tags == tag].tolist())


def test_halved_lights_are_left_out_with_their_parent(things):
    create(BakeSettings(target_triangles=80, split_share=0.5))
    found = extract()
    assert len(found.light_mesh) == 80
    for mesh in found.snapshot.meshes:
        out = leaves_out(found.light_mesh.links, found.light_mesh.tag_ids[None], mesh.tag_ids[:, None])
        assert out.any(axis=1).all()


def test_creating_again_replaces_the_tags_and_needs_no_more_lights(things):
    first = create()
    tags = [read_faces(thing, "vlm_tag").tolist() for thing in things]
    again = create()
    assert len(again.bake.light_mesh) == len(first.bake.light_mesh)
    assert np.array_equal(again.bake.light_mesh.vertices, first.bake.light_mesh.vertices)
    assert [len(set(read_faces(thing, "vlm_tag").tolist())) for thing in things] == [len(set(each)) for each in tags]
    assert len(again.bake.light_mesh.links) == len(first.bake.light_mesh.links)


def test_tags_that_artists_gave_stay(things):
    things[0]["vlm_tag"] = 7
    create()
    assert things[0]["vlm_tag"] == 7
    assert not read_faces(things[0], "vlm_tag").any()
    assert 7 in extract().light_mesh.tag_ids


def test_a_surface_that_changed_meanwhile_stops_all_writing(things):
    made = authoring.from_scene(bpy.context, SETTINGS, tag_regions=True)(silent)
    bpy.data.objects.remove(things[0])
    count = len(bpy.data.objects)
    with pytest.raises(InvalidInput, match="changed while"):
        authoring.write(made)
    assert len(bpy.data.objects) == count
