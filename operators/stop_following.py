# SPDX-License-Identifier: GPL-3.0-or-later
"""Free light meshes from the objects that they follow."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring, light_colors
from ..vlm_addon.blender.following import animation
from ..vlm_addon.core.errors import VlmError


class VLM_OT_stop_following(Operator):  # noqa: N801 (Blender's naming of classes)
    """Free the selected light meshes from what they follow; they keep the shape and place of this frame"""

    bl_idname = "vlm.stop_following"
    bl_label = "Stop Following"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, animation.free_problem(context))

    def execute(self, context):
        try:
            count = animation.free(context)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Freed {light_colors.light_mesh_count(count)}")
        return {"FINISHED"}
