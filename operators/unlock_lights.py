# SPDX-License-Identifier: GPL-3.0-or-later
"""Let lights be made again with their light mesh."""

from bpy.types import Operator

from ..vlm_addon.blender import light_colors
from ..vlm_addon.blender.light_operator import LightOperator


class VLM_OT_unlock_lights(LightOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Let the selected lights change again when the light mesh is created again or recolored from materials"""

    bl_idname = "vlm.unlock_lights"
    bl_label = "Unlock Lights"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    def change_all(self, context, things):
        return light_colors.lock(things, locked=False)
