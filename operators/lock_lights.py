# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep lights as they are when their light mesh is made again."""

from bpy.types import Operator

from ..vlm_addon.blender import light_colors
from ..vlm_addon.blender.light_operator import LightOperator


class VLM_OT_lock_lights(LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Keep the selected lights as they are when the light mesh is created again or recolored from materials"""

    bl_idname = "vlm.lock_lights"
    bl_label = "Lock Lights"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    def change_all(self, context, things):
        return light_colors.lock(things, locked=True)
