# SPDX-License-Identifier: GPL-3.0-or-later
"""Take tag ids away."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.tagging import light_tags
from ..vlm_addon.core.errors import VlmError


class VLM_OT_clear_tag(Operator):  # noqa: N801 (Blender's naming of classes)
    """Take the tag ids of the selected light meshes and objects, or of the selected faces in Edit Mode, away"""

    bl_idname = "vlm.clear_tag"
    bl_label = "Clear Tag"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, light_tags.tag_problem(context))

    def execute(self, context):
        try:
            cleared = light_tags.clear_tag(context)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return light_tags.report_tagged(self, cleared)
