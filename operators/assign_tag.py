# SPDX-License-Identifier: GPL-3.0-or-later
"""Give lights and what they stand for one tag id."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.tagging import light_tags
from ..vlm_addon.core.errors import VlmError
from ..vlm_addon.core.tag_pairs import FIRST_AUTOMATIC


class VLM_OT_assign_tag(Operator):  # noqa: N801 (Blender's naming of classes)
    """Give the selected light meshes and objects, or the selected faces in Edit Mode, one tag id: surfaces leave out \
the lights of their own id"""

    bl_idname = "vlm.assign_tag"
    bl_label = "Assign Tag"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    tag: bpy.props.IntProperty(
        name="Tag",
        description="The id; 0 takes one that nothing has yet. Larger ids than the limit come from pairing",
        min=0,
        max=FIRST_AUTOMATIC - 1,
        default=0,
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, light_tags.tag_problem(context))

    def execute(self, context):
        try:
            tagged = light_tags.assign_tag(context, self.tag)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return light_tags.report_tagged(self, tagged)
