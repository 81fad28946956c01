# SPDX-License-Identifier: GPL-3.0-or-later
"""Let lights leave out visible objects."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.tagging import links
from ..vlm_addon.core.errors import VlmError


class VLM_OT_link_receiver(Operator):  # noqa: N801 (Blender's naming of classes)
    """Keep the bounce of the chosen lights off the selected visible objects; direct light and shadows stay"""

    bl_idname = "vlm.link_receiver"
    bl_label = "Leave Out Objects"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    receiver: bpy.props.StringProperty(
        name="Object",
        description="Object that gets no bounce of these lights; empty: all selected visible objects",
        search=lambda self, context, text: links.receiver_names(context, text),
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_faces_problem(context))

    def invoke(self, context, event):
        """Ask for the object where none is selected: in Edit Mode of a light mesh none can be."""
        if bpy.app.background or links.named_receivers(context, self.receiver):
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        try:
            linked = links.link_receivers(context, links.named_receivers(context, self.receiver))
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, links.linked_text(linked))
        return {"FINISHED"}
