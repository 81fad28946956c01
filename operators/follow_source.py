# SPDX-License-Identifier: GPL-3.0-or-later
"""Let light meshes move with what they stand for."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.following import animation
from ..vlm_addon.blender.following.follow_source import AUTO, WAYS
from ..vlm_addon.core.errors import VlmError


class VLM_OT_follow_source(Operator):  # noqa: N801 (Blender's naming of classes)
    """Parent the selected light meshes to their sources, or to the other selected objects, with the sources' rig"""

    bl_idname = "vlm.follow_source"
    bl_label = "Follow Source"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    way: bpy.props.EnumProperty(
        name="By", description="How the light mesh is deformed with its source", items=WAYS, default=AUTO
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, animation.follow_problem(context))

    def execute(self, context):
        try:
            sentences = animation.follow(context, self.way)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for level, sentence in sentences:
            self.report({level}, sentence)
        return {"FINISHED"}
