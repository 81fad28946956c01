# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys of the drawing tools, as entries that the preferences can change."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.drawing import draw_keys


class VLM_OT_draw_key(Operator):  # noqa: N801 (Blender's naming of classes)
    """What a key does while a stroke of the drawing tools goes on"""

    bl_idname = draw_keys.KEY_OPERATOR
    bl_label = "Drawing Key"
    bl_options = {"INTERNAL"}  # noqa: RUF012 (Blender reads it)

    action: bpy.props.EnumProperty(name="Action", description="What the key does", items=draw_keys.ACTIONS)

    @classmethod
    def poll(cls, context):
        # The running stroke reads the key itself
        return authoring.allow(cls, "This key works while a light is being drawn")

    def execute(self, context):
        return {"CANCELLED"}
