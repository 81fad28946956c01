# SPDX-License-Identifier: GPL-3.0-or-later
"""Make virtual lights of the selected faces of visible meshes."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_fill, draw_operators


class VLM_OT_draw_fill(draw_operators.NewLights, Operator):  # noqa: N801 (Blender's naming of classes)
    """Copy selected faces of visible meshes as lights behind them, with their color and tag. Leaves Edit Mode"""

    bl_idname = "vlm.draw_fill"
    bl_label = "Lights from Selected Faces"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, draw_operators.fill_problem(context))

    def carry_out(self, context):
        return draw_fill.fill(context, self.target)
