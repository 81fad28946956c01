# SPDX-License-Identifier: GPL-3.0-or-later
"""Erase virtual lights under a brush."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_erase, draw_gestures, draw_operators, draw_points
from ..vlm_addon.blender.interface import availability


class VLM_OT_draw_erase(draw_gestures.EraseGesture, draw_operators.Stroke, Operator):  # noqa: N801 (Blender's naming of classes)
    """Drag over lights of the chosen light meshes to delete them; locked ones are kept"""

    bl_idname = "vlm.draw_erase"
    bl_label = "Erase Lights"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    radius: bpy.props.FloatProperty(
        name="Radius", description="Of the brush, around each point of the stroke", default=0.05, min=0.0, unit="LENGTH"
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_faces_problem(context))

    def carry_out(self, context):
        points, normals = draw_points.stroke(self.points, self.normals, least=1)
        return draw_erase.erase(context, points, normals, self.radius)
