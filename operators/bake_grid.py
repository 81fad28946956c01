# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake the light grid of the scene beside the .blend."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.baking import bake_grid
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_bake_grid(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Bake which lights light which place, for engines and the command line, into a folder beside the .blend"""

    bl_idname = "vlm.bake_grid"
    bl_label = "Bake Light Grid"
    bl_options = {"REGISTER"}  # noqa: RUF012 (a file is written, Blender's data stays: nothing to undo)

    visibility: bpy.props.BoolProperty(
        name="Visibility",
        description="Also bake what the surfaces see of the lights: takes a graphics device, and minutes without one",
        default=False,
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, bake_grid.bake_problem(context))

    def prepare(self, context):
        return bake_grid.from_scene(context, self.visibility)

    def finish(self, context, result):
        _, sentence = bake_grid.write(context, result)
        for finding in result.grid.findings:
            self.report({"WARNING"}, str(finding))
        self.report({"INFO"}, sentence)
