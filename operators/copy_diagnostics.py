# SPDX-License-Identifier: GPL-3.0-or-later
"""Copy what somebody who helps needs to know."""

from bpy.types import Operator

from ..vlm_addon.blender.support.diagnostics import diagnostics


class VLM_OT_copy_diagnostics(Operator):  # noqa: N801 (Blender's naming of classes)
    """Copy versions, device, settings and the renderer's last log lines, without names of your files and objects"""

    bl_idname = "vlm.copy_diagnostics"
    bl_label = "Copy Diagnostics"
    bl_options = {"REGISTER"}  # noqa: RUF012 (nothing of the file is changed)

    def execute(self, context):
        text = diagnostics(context)
        context.window_manager.clipboard = text
        self.report({"INFO"}, f"Copied {len(text.splitlines())} lines: paste them into a report")
        return {"FINISHED"}
