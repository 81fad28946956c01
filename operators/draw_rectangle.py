# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw a rectangle of virtual lights onto a visible surface."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_gestures, draw_lights, draw_operators, draw_points, draw_shapes


class VLM_OT_draw_rectangle(draw_gestures.RectangleGesture, draw_operators.NewLightsStroke, Operator):  # noqa: N801 (Blender's naming of classes)
    """Drag a rectangle onto a surface, one light or a grid of them. They take color and tag from the surface"""

    bl_idname = "vlm.draw_rectangle"
    bl_label = "Draw Light Rectangle"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    along: bpy.props.FloatVectorProperty(
        name="Along",
        description="Direction of the columns; none: level with the ground, or along x on a floor",
        subtype="DIRECTION",
        options={"SKIP_SAVE"},
    )
    columns: bpy.props.IntProperty(
        name="Columns", description="Lights side by side", default=1, min=1, max=draw_shapes.MOST_ROWS
    )
    rows: bpy.props.IntProperty(
        name="Rows", description="Lights one over the other", default=1, min=1, max=draw_shapes.MOST_ROWS
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, draw_operators.draw_problem(context))

    def carry_out(self, context):
        corners, normals = draw_points.stroke(self.points, self.normals, least=2, normals_needed=True)
        points, rings = draw_shapes.rectangle(
            corners[0], corners[-1], normals[0], draw_points.vector(self.along), self.columns, self.rows
        )
        facing = draw_points.repeated(normals[0], len(rings))
        return draw_lights.draw(context, points, rings, facing, self.offset, self.target)
