# SPDX-License-Identifier: GPL-3.0-or-later
"""Take tag ids apart that copies share."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring, tag_separation
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.long_operator import LongOperator
from ..vlm_addon.blender.tagging import tag_pairing


class VLM_OT_repair_tags(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Give copies of light meshes and objects ids of their own where they share some with what they do not stand for; \
objects that share an id without any light of theirs lose it"""

    bl_idname = "vlm.repair_tags"
    bl_label = "Repair Tags"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.light_scene_tags_problem(context))

    def prepare(self, context):
        return tag_pairing.scene_work(context, tag_separation.separate)

    def finish(self, context, result):
        self.report({"INFO"}, tag_separation.repaired_text(result, tag_pairing.write_retagged(context, result)))
