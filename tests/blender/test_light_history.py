# SPDX-License-Identifier: GPL-3.0-or-later
"""The check tells of surfaces what can be mended with their lights: not of those that lights do not stand for."""

import bpy
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_repair import work_after, work_on, write_fixed
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.progress import silent


def check():
    bpy.context.view_layer.update()
    checking.list_checked(checking.check(bpy.context)(silent))
    return [item.kind for item in bpy.context.scene.vlm.findings if item.kind]


@pytest.fixture
def curtain(make_cube, make_plane):
    """(room, curtain): a sheet amid a room, seen from both sides."""
    ensure_scene_settings()
    room, sheet = make_cube("room"), make_plane("curtain", size=0.8)
    room.data.flip_normals()
    sheet.location.z = -0.6
    bpy.context.view_layer.update()
    return room, sheet


def create(*things):
    authoring.write(authoring.from_objects(list(things), "VLM", BakeSettings(target_triangles=80), False)(silent))


def test_a_sheet_that_has_no_lights_is_no_matter_of_the_lights_behind_it(curtain):
    create(curtain[0])
    assert check() == []


def test_a_sheet_with_lights_is_told_and_its_fix_ends_that(curtain):
    create(*curtain)
    assert check() == [kinds.TWO_SIDED]
    work = work_on(bpy.context, kinds.TWO_SIDED)
    while work is not None:
        made = work(silent)
        write_fixed(bpy.context, made)
        work = work_after(bpy.context, made)
    assert check() == []
