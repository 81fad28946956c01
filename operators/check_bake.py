# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the scene with what its light meshes and light grid were made from."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.baking import bake_state
from ..vlm_addon.core.errors import VlmError


class VLM_OT_check_bake(Operator):  # noqa: N801 (Blender's naming of classes)
    """Compare the scene with what its light meshes and its light grid were made from; reads all visible geometry"""

    bl_idname = "vlm.check_bake"
    bl_label = "Compare with Bake"
    bl_options = {"REGISTER"}  # noqa: RUF012 (nothing of the file is changed: nothing to undo)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, bake_state.compare_problem(context))

    def execute(self, context):
        try:
            changes = bake_state.compare(context)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for change in changes:
            self.report({"WARNING"}, f"Out of date: {change}")
        self.report({"INFO"}, f"Differences to the bake: {len(changes)}")
        return {"FINISHED"}
