# SPDX-License-Identifier: GPL-3.0-or-later
"""Remove the baked light grid of the scene."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.baking import bake_grid
from ..vlm_addon.core.errors import VlmError


class VLM_OT_clear_bake(Operator):  # noqa: N801 (Blender's naming of classes)
    """Remove the scene's baked light grid from disk; light meshes stay. This cannot be undone: bake again"""

    bl_idname = "vlm.clear_bake"
    bl_label = "Clear Bake"
    bl_options = {"REGISTER"}  # noqa: RUF012 (a file is removed, which undo does not bring back)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, bake_grid.clear_problem(context))

    def execute(self, context):
        try:
            sentence = bake_grid.clear(context)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, sentence)
        return {"FINISHED"}
