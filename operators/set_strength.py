# SPDX-License-Identifier: GPL-3.0-or-later
"""Strength and hue of whole light meshes."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring, light_colors
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.light_meshes import chosen_light_meshes
from ..vlm_addon.core.errors import VlmError


class VLM_OT_set_strength(Operator):  # noqa: N801 (Blender's naming of classes)
    """Factors on all lights of the selected light meshes; the colors of their faces stay as they are"""

    bl_idname = "vlm.set_strength"
    bl_label = "Set Strength"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    strength: bpy.props.FloatProperty(
        name="Strength",
        description="Factor on what all lights send out: 5 makes the bounce five times as strong",
        soft_min=0.0,
        soft_max=10.0,
        default=1.0,
    )
    hue: bpy.props.FloatVectorProperty(
        name="Hue",
        description="Factor on each channel; white changes nothing",
        subtype="COLOR",
        size=3,
        soft_min=0.0,
        default=(1.0, 1.0, 1.0),
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.whole_light_mesh_problem(context))

    def invoke(self, context, event):
        self.strength, self.hue = light_colors.strength_of(chosen_light_meshes(context)[0])
        return self.execute(context)

    def execute(self, context):
        try:
            count = light_colors.set_strength(chosen_light_meshes(context), self.strength, self.hue)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Set the strength of {light_colors.light_mesh_count(count)}")
        return {"FINISHED"}
