# SPDX-License-Identifier: GPL-3.0-or-later
"""One button: a virtual light mesh for the visible scene, our engine, a rendered picture."""

from bpy.types import Operator

from ..vlm_addon.bake import BakeSettings
from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.interface.properties import property_annotations, settings_from
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_light_scene(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Make virtual lights for the visible scene, keeping light meshes that are there, and render it lit by them"""

    bl_idname = "vlm.light_scene"
    bl_label = "Light Scene"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)
    __annotations__ = property_annotations(BakeSettings)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_scene_problem(context))

    def prepare(self, context):
        return authoring.from_lit_scene(context, settings_from(self, BakeSettings))

    def finish(self, context, result):
        self.report({"INFO"}, authoring.write(result))
        authoring.render_picture(context)
