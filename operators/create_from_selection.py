# SPDX-License-Identifier: GPL-3.0-or-later
"""Create a virtual light mesh from the selected objects."""

from bpy.types import Operator

from ..vlm_addon.bake import BakeSettings
from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.interface.properties import property_annotations, settings_from
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_create_from_selection(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Make virtual lights that stand for the bounce light of the selected objects"""

    bl_idname = "vlm.create_from_selection"
    bl_label = "Create from Selection"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)
    __annotations__ = {**property_annotations(BakeSettings), **authoring.TAG_REGIONS}

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.selection_problem(context))

    def prepare(self, context):
        return authoring.from_selection(context, settings_from(self, BakeSettings), self.tag_regions)

    def finish(self, context, result):
        self.report({"INFO"}, authoring.write(result))
