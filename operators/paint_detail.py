# SPDX-License-Identifier: GPL-3.0-or-later
"""Paint where a visible mesh gets more lights, or none."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring, detail_painting
from ..vlm_addon.blender.interface import availability


class VLM_OT_paint_detail(Operator):  # noqa: N801 (Blender's naming of classes)
    """Paint on the visible mesh where the next light mesh gets more lights, or none at all"""

    bl_idname = "vlm.paint_detail"
    bl_label = "Paint Detail"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    group: bpy.props.EnumProperty(
        name="Detail",
        description="What the weights mean that are painted",
        items=detail_painting.CHOICES,
        default=detail_painting.MORE,
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.painting_problem(context))

    def execute(self, context):
        self.report({"INFO"}, detail_painting.start(context, self.group))
        return {"FINISHED"}
