# SPDX-License-Identifier: GPL-3.0-or-later
"""Show the light grid of the scene in the 3D views."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.long_operator import LongOperator
from ..vlm_addon.blender.overlays import grid_view


class VLM_OT_show_light_grid(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Make the light grid anew and show its cells: how many lights count, or how far light may be off"""

    bl_idname = "vlm.show_light_grid"
    bl_label = "Show Light Grid"
    bl_options = {"REGISTER"}  # noqa: RUF012 (Blender's data stays as it is: nothing to undo)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.check_problem(context))

    def prepare(self, context):
        return grid_view.from_scene(context)

    def finish(self, context, result):
        self.report({"INFO"}, grid_view.show(context, result))
