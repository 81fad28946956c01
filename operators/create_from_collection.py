# SPDX-License-Identifier: GPL-3.0-or-later
"""Create a virtual light mesh from a collection."""

import bpy
from bpy.types import Operator

from ..vlm_addon.bake import BakeSettings
from ..vlm_addon.blender import authoring
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.interface.properties import property_annotations, settings_from
from ..vlm_addon.blender.long_operator import LongOperator
from ..vlm_addon.core.errors import InvalidInput


class VLM_OT_create_from_collection(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Make virtual lights that stand for the bounce light of a collection's objects"""

    bl_idname = "vlm.create_from_collection"
    bl_label = "Create from Collection"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)
    __annotations__ = {
        "collection": bpy.props.StringProperty(
            name="Collection", description="Name of the collection; the active one where it is empty"
        ),
        **property_annotations(BakeSettings),
        **authoring.TAG_REGIONS,
    }

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.collection_problem(context))

    def prepare(self, context):
        collection = bpy.data.collections.get(self.collection) if self.collection else context.collection
        if collection is None:
            raise InvalidInput(f"collection {self.collection!r}", "there is none of that name", "name one of this file")
        settings = settings_from(self, BakeSettings)
        return authoring.from_collection(collection, settings, self.tag_regions)

    def finish(self, context, result):
        self.report({"INFO"}, authoring.write(result))
