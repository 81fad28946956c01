# SPDX-License-Identifier: GPL-3.0-or-later
"""Make lights stronger, weaker or tinted."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import light_colors
from ..vlm_addon.blender.light_operator import LightOperator
from ..vlm_addon.core import color_changes


class VLM_OT_multiply_color(LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Multiply the colors of the selected lights, channel by channel"""

    bl_idname = "vlm.multiply_color"
    bl_label = "Multiply Color"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    factor: bpy.props.FloatProperty(
        name="Factor", description="5 makes lights five times as strong", min=0.0, soft_max=10.0, default=1.0
    )
    tint: bpy.props.FloatVectorProperty(
        name="Tint",
        description="Factor on each channel; white changes no hue",
        subtype="COLOR",
        size=3,
        min=0.0,
        default=(1.0, 1.0, 1.0),
    )
    quantity: bpy.props.EnumProperty(
        name="Change", description="Which values to multiply", items=light_colors.QUANTITIES, default=light_colors.BOTH
    )

    def change_all(self, context, things):
        change = color_changes.multiply([channel * self.factor for channel in self.tint])
        return light_colors.change_colors(things, change, self.quantity)
