# SPDX-License-Identifier: GPL-3.0-or-later
"""Look for what is wrong with the scene's virtual light meshes."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring, checking
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_check(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Look for what is wrong with the virtual light meshes; the findings are listed in the sidebar"""

    bl_idname = "vlm.check"
    bl_label = "Check"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.check_problem(context))

    def prepare(self, context):
        return checking.check(context)

    def finish(self, context, result):
        checking.list_checked(result)
        for finding in result.findings:
            self.report({"WARNING"}, str(finding))
        self.report({"INFO"}, authoring.counted_findings(len(result.findings)))
