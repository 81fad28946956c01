# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the colour of lights from a visible surface."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import light_colors, recolor
from ..vlm_addon.blender.eyedropper import Eyedropper
from ..vlm_addon.blender.light_operator import LightOperator


class VLM_OT_pick_color(Eyedropper, LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Click a visible surface: the selected lights take its diffuse color, averaged over an area of their size"""

    bl_idname = "vlm.pick_color"
    bl_label = "Pick Color"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    place: bpy.props.EnumProperty(name="From", description="Where the color is taken", items=recolor.PLACES)
    location: bpy.props.FloatVectorProperty(
        name="Location",
        description="The surface nearest to this point of the world",
        subtype="TRANSLATION",
        unit="LENGTH",
        size=3,
    )
    source: bpy.props.StringProperty(name="Object", description="Look at this object alone; all where it is empty")
    radius: bpy.props.FloatProperty(
        name="Radius",
        description="Average over the surface so far around the point; 0: the size of the selected lights",
        subtype="DISTANCE",
        min=0.0,
        default=0.0,
    )
    quantity: bpy.props.EnumProperty(
        name="Change", description="Which values to take", items=light_colors.QUANTITIES, default=light_colors.COLOR
    )

    def picked(self, point, thing):
        self.place, self.location, self.source = recolor.POINT, point, thing.name

    def change_all(self, context, things):
        place = recolor.Place(self.place, tuple(self.location), self.source, self.radius)
        return recolor.pick(context, things, place, self.quantity)
