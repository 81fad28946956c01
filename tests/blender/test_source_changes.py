# SPDX-License-Identifier: GPL-3.0-or-later
"""Artists hear by name what has become of the objects that their light meshes were made from."""

import bpy
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking
from vlm_addon.core.progress import silent


@pytest.fixture
def two_cubes(make_cube, scene):
    """A light mesh of the cubes Cube and Wall."""
    from vlm_addon.blender.interface.properties import ensure_scene_settings

    ensure_scene_settings()
    make_cube("Cube")
    make_cube("Wall").location.x = 5.0
    bpy.context.view_layer.update()
    authoring.write(authoring.from_scene(bpy.context, BakeSettings())(silent))


def checked():
    """The findings of a check, as texts."""
    checking.list_checked(checking.check(bpy.context)(silent))
    return [item.text for item in bpy.context.scene.vlm.findings]


def test_nothing_is_said_of_sources_that_are_as_they_were(two_cubes):
    bpy.data.objects["Cube"].name = "Crate"
    assert not [text for text in checked() if "Crate" in text or "Cube" in text]


def test_a_source_that_was_moved_is_told_first(two_cubes):
    bpy.data.objects["Wall"].location.y = 9.0
    bpy.context.view_layer.update()
    found = checked()
    assert found[0].startswith("light mesh 'VLM': 'Wall' moved or changed since it was made")
    assert len(found) > 1, "its lights have no surface in front of them any more"


def test_sources_that_are_gone_or_hidden_are_named(two_cubes):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.data.objects["Wall"].hide_render = True
    bpy.ops.mesh.primitive_plane_add()
    assert checked()[0].startswith("light mesh 'VLM': 'Cube' is gone; 'Wall' shows no surface in renders")
