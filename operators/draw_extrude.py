# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw a strip of virtual lights from an edge along a way over visible surfaces."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_gestures, draw_lights, draw_operators, draw_points, draw_shapes


class VLM_OT_draw_extrude(draw_gestures.ExtrudeGesture, draw_operators.NewLightsStroke, Operator):  # noqa: N801 (Blender's naming of classes)
    """Drag an edge of a light along a surface: a strip of lights follows"""

    bl_idname = "vlm.draw_extrude"
    bl_label = "Extrude Lights Along"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    edge: bpy.props.StringProperty(
        name="Edge",
        description=f"The two ends of the edge that the strip begins with {draw_operators.POINTS}",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, draw_operators.draw_problem(context))

    def carry_out(self, context):
        edge = draw_points.exactly(self.edge, 2, "edge")
        path, normals = draw_points.stroke(self.points, self.normals, least=1, normals_needed=True)
        points, rings, facing = draw_shapes.strip(edge, path, normals)
        return draw_lights.draw(context, points, rings, facing, self.offset, self.target)
