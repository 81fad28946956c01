# SPDX-License-Identifier: GPL-3.0-or-later
"""Tag what no light can hide behind."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.long_operator import LongOperator
from ..vlm_addon.blender.tagging import tag_pairing


class VLM_OT_tag_thin(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Find thin bodies and sheets that are seen from both sides, and let their faces leave out the lights that stand \
for them; tags that there are stay. Up to a minute for large scenes"""

    bl_idname = "vlm.tag_thin"
    bl_label = "Tag Thin Surfaces"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.whole_light_mesh_problem(context))

    def prepare(self, context):
        return tag_pairing.chosen_work(context, tag_pairing.pair_thin)

    def finish(self, context, result):
        self.report({"INFO"}, tag_pairing.paired_text(result, tag_pairing.write_retagged(context, result)))
