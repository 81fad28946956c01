# SPDX-License-Identifier: GPL-3.0-or-later
"""Open the manual that comes with the extension."""

from bpy.types import Operator

from ..vlm_addon.blender.support import documentation


class VLM_OT_open_documentation(Operator):  # noqa: N801 (Blender's naming of classes)
    """Open the manual that comes with the extension; it needs no network"""

    bl_idname = "vlm.open_documentation"
    bl_label = "Documentation"
    bl_options = {"REGISTER"}  # noqa: RUF012 (nothing of the file is changed)

    def execute(self, context):
        self.report({"INFO"}, f"Manual: {documentation.open_manual(context)}")
        return {"FINISHED"}
