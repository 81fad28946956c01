# SPDX-License-Identifier: GPL-3.0-or-later
"""Give lights a colour."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import light_colors
from ..vlm_addon.blender.light_operator import LightOperator
from ..vlm_addon.core import color_changes


class VLM_OT_fill_color(LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Give the selected lights one color; what is visible stays as it is"""

    bl_idname = "vlm.fill_color"
    bl_label = "Fill Color"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    color: bpy.props.FloatVectorProperty(
        name="Color", description="Color of the bounce", subtype="COLOR", size=3, min=0.0, default=(0.8, 0.8, 0.8)
    )
    intensity: bpy.props.FloatProperty(
        name="Intensity",
        description="Factor on the color: above 1, more light may leave than arrives",
        min=0.0,
        soft_max=10.0,
        default=1.0,
    )
    quantity: bpy.props.EnumProperty(
        name="Change", description="Which values to fill", items=light_colors.QUANTITIES, default=light_colors.COLOR
    )

    def change_all(self, context, things):
        change = color_changes.fill([channel * self.intensity for channel in self.color])
        return light_colors.change_colors(things, change, self.quantity)
