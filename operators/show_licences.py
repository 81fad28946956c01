# SPDX-License-Identifier: GPL-3.0-or-later
"""List the licences of the extension and of what it brings along."""

from bpy.types import Operator

from ..vlm_addon.blender.support.licences import licences

POPUP_WIDTH = 480


class VLM_OT_show_licences(Operator):  # noqa: N801 (Blender's naming of classes)
    """List the licenses of the extension and of the software that comes with it"""

    bl_idname = "vlm.show_licences"
    bl_label = "Licenses"
    bl_options = {"REGISTER"}  # noqa: RUF012 (nothing of the file is changed)

    def invoke(self, context, event):
        return context.window_manager.invoke_popup(self, width=POPUP_WIDTH)

    def draw(self, context):
        for licence in licences():
            self.layout.label(text=str(licence), translate=False)

    def execute(self, context):
        for licence in licences():
            self.report({"INFO"}, str(licence))
        return {"FINISHED"}
