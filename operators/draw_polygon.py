# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw a polygon of virtual light onto a visible surface."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_gestures, draw_lights, draw_operators, draw_points


class VLM_OT_draw_polygon(draw_gestures.PolygonGesture, draw_operators.NewLightsStroke, Operator):  # noqa: N801 (Blender's naming of classes)
    """Click the corners of a light on a surface, or drag around it. It takes color and tag from the surface"""

    bl_idname = "vlm.draw_polygon"
    bl_label = "Draw Light Polygon"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, draw_operators.draw_problem(context))

    def carry_out(self, context):
        points, normals = draw_points.stroke(self.points, self.normals, least=3)
        ring = [list(range(len(points)))]
        return draw_lights.draw(context, points, ring, draw_points.mean(normals), self.offset, self.target)
