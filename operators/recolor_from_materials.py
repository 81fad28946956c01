# SPDX-License-Identifier: GPL-3.0-or-later
"""Give lights the colours of the visible materials again."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring, light_colors, recolor
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.light_meshes import chosen_light_meshes
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_recolor_from_materials(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Give the selected lights the mean color of the visible surface that each stands for; some seconds for 5,000"""

    bl_idname = "vlm.recolor_from_materials"
    bl_label = "Recolor from Materials"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    quantity: bpy.props.EnumProperty(
        name="Change", description="Which values to look up", items=light_colors.QUANTITIES, default=light_colors.BOTH
    )
    keep_locked: bpy.props.BoolProperty(name="Keep Locked", description="Leave locked lights as they are", default=True)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_faces_problem(context))

    def prepare(self, context):
        return recolor.from_materials(context, chosen_light_meshes(context), self.quantity, self.keep_locked)

    def finish(self, context, result):
        self.report({"INFO"}, recolor.write_recolored(context, result))
