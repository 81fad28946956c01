# SPDX-License-Identifier: GPL-3.0-or-later
"""Tag lights and the faces that they stand for together."""

from bpy.types import Operator

from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.long_operator import LongOperator
from ..vlm_addon.blender.tagging import tag_pairing


class VLM_OT_pair_tags(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Let every face leave out the lights that stand for it, by tags and links beside those that there are; of the \
selected light meshes, on the selected objects or else on all that they were made from. Seconds for 5,000 lights"""

    bl_idname = "vlm.pair_tags"
    bl_label = "Pair Tags"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.whole_light_mesh_problem(context))

    def prepare(self, context):
        return tag_pairing.chosen_work(context, tag_pairing.pair)

    def finish(self, context, result):
        self.report({"INFO"}, tag_pairing.paired_text(result, tag_pairing.write_retagged(context, result)))
