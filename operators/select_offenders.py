# SPDX-License-Identifier: GPL-3.0-or-later
"""Show the lights that a finding is about."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring, findings
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.core.errors import VlmError


class VLM_OT_select_offenders(Operator):  # noqa: N801 (Blender's naming of classes)
    """Edit the light meshes that this finding of the last check names, with just its faces selected"""

    bl_idname = "vlm.select_offenders"
    bl_label = "Select Offenders"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    index: bpy.props.IntProperty(name="Finding", description="Number of the finding in the list", min=0)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.findings_problem(context))

    def execute(self, context):
        try:
            count = findings.select_offenders(context, self.index)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Selected {authoring.faces(count)}")
        return {"FINISHED"}
