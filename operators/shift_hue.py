# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn the hue of lights."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import light_colors
from ..vlm_addon.blender.light_operator import LightOperator
from ..vlm_addon.core import color_changes


class VLM_OT_shift_hue(LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Turn the hue of the selected lights; each sends out as much light as before"""

    bl_idname = "vlm.shift_hue"
    bl_label = "Shift Hue"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    turn: bpy.props.FloatProperty(
        name="Turn",
        description="Way round the circle of hues: 120° make red green, 240° make it blue",
        subtype="ANGLE",
        soft_min=-3.141592653589793,
        soft_max=3.141592653589793,
        default=0.0,
    )
    saturation: bpy.props.FloatProperty(
        name="Saturation",
        description="Factor on the saturation: 0 makes lights gray",
        min=0.0,
        soft_max=2.0,
        default=1.0,
    )
    quantity: bpy.props.EnumProperty(
        name="Change", description="Which values to change", items=light_colors.QUANTITIES, default=light_colors.BOTH
    )

    def change_all(self, context, things):
        change = color_changes.shift_hue(self.turn, self.saturation)
        return light_colors.change_colors(things, change, self.quantity)
