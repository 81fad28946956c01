# SPDX-License-Identifier: GPL-3.0-or-later
"""Cut virtual lights along a way over them."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_erase, draw_gestures, draw_operators, draw_points
from ..vlm_addon.blender.interface import availability


class VLM_OT_draw_cut(draw_gestures.CutGesture, draw_operators.Stroke, Operator):  # noqa: N801 (Blender's naming of classes)
    """Click points across lights of the chosen light meshes: they are cut in two along the way"""

    bl_idname = "vlm.draw_cut"
    bl_label = "Cut Lights"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_faces_problem(context))

    def carry_out(self, context):
        return draw_erase.cut(context, *draw_points.stroke(self.points, self.normals, least=2))
