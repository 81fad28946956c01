# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that run from one to another over a light mesh."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import light_colors
from ..vlm_addon.blender.light_operator import LightOperator


class VLM_OT_gradient_color(LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Let the color of the selected lights run from one to another, along a direction or between two points"""

    bl_idname = "vlm.gradient_color"
    bl_label = "Gradient Color"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    placement: bpy.props.EnumProperty(
        name="Placement", description="Where the gradient runs", items=light_colors.PLACEMENTS
    )
    direction: bpy.props.FloatVectorProperty(
        name="Direction",
        description="World space: from the first to the last selected light along it",
        subtype="XYZ",
        size=3,
        default=(0.0, 0.0, 1.0),
    )
    start: bpy.props.FloatVectorProperty(
        name="Start",
        description="Where the first color ends, world space",
        subtype="TRANSLATION",
        unit="LENGTH",
        size=3,
    )
    end: bpy.props.FloatVectorProperty(
        name="End",
        description="Where the second color begins, world space",
        subtype="TRANSLATION",
        unit="LENGTH",
        size=3,
        default=(0.0, 0.0, 1.0),
    )
    first_color: bpy.props.FloatVectorProperty(
        name="First Color", description="Color at the start", subtype="COLOR", size=3, min=0.0, default=(0.0, 0.0, 0.0)
    )
    last_color: bpy.props.FloatVectorProperty(
        name="Last Color", description="Color at the end", subtype="COLOR", size=3, min=0.0, default=(1.0, 1.0, 1.0)
    )
    multiplies: bpy.props.BoolProperty(
        name="Multiply", description="Multiply the colors that the lights have instead of replacing them", default=False
    )
    quantity: bpy.props.EnumProperty(
        name="Change", description="Which values to change", items=light_colors.QUANTITIES, default=light_colors.COLOR
    )

    def change_all(self, context, things):
        ends = light_colors.gradient_ends(things, self.placement, self.direction, self.start, self.end)
        change = light_colors.gradient(ends, self.first_color, self.last_color, self.multiplies)
        return light_colors.change_colors(things, change, self.quantity)
