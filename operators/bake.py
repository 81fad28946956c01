# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring the scene's virtual light meshes up to date."""

from bpy.types import Operator

from ..vlm_addon.bake import BakeSettings
from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.interface.properties import property_annotations, settings_from
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_bake(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Make virtual lights for the visible scene where it has none, and check them"""

    bl_idname = "vlm.bake"
    bl_label = "Bake"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)
    __annotations__ = property_annotations(BakeSettings)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.visible_scene_problem(context))

    def prepare(self, context):
        return authoring.from_visible_scene(context, settings_from(self, BakeSettings))

    def finish(self, context, result):
        count = len(result.bake.findings)
        told = f"{authoring.write(result)}; {authoring.counted_findings(count)}"
        self.report({"WARNING" if count else "INFO"}, told)
