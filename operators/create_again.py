# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a light mesh anew of what it was made from."""

from bpy.types import Operator

from ..vlm_addon.bake import BakeSettings
from ..vlm_addon.blender import authoring, create_again
from ..vlm_addon.blender.interface.properties import property_annotations, settings_from
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_create_again(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Make the active light mesh anew of the objects that it was made from; locked lights stay as they are"""

    bl_idname = "vlm.create_again"
    bl_label = "Create Again"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)
    __annotations__ = {**property_annotations(BakeSettings), **authoring.TAG_REGIONS}

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, create_again.again_problem(context))

    def prepare(self, context):
        return create_again.again(context, settings_from(self, BakeSettings), self.tag_regions)

    def finish(self, context, result):
        self.report({"INFO"}, authoring.write(result))
