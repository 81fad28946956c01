# SPDX-License-Identifier: GPL-3.0-or-later
"""Let lights light visible objects again that they left out."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.tagging import links
from ..vlm_addon.core.errors import VlmError


class VLM_OT_unlink_receiver(Operator):  # noqa: N801 (Blender's naming of classes)
    """Let the chosen lights light the selected visible objects again, or all objects if none is selected"""

    bl_idname = "vlm.unlink_receiver"
    bl_label = "Light Objects Again"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    receiver: bpy.props.StringProperty(
        name="Object", description="Object that these lights light again; empty: all selected visible objects, or all"
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_faces_problem(context))

    def execute(self, context):
        try:
            unlinked = links.unlink_receivers(context, links.named_receivers(context, self.receiver))
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not unlinked.pairs:
            self.report({"WARNING"}, "Nothing was linked: these lights leave out their own tag alone")
            return {"CANCELLED"}
        self.report({"INFO"}, links.unlinked_text(unlinked))
        return {"FINISHED"}
