# SPDX-License-Identifier: GPL-3.0-or-later
"""Mend what the check has found."""

import bpy
from bpy.types import Operator

from ..vlm_addon.blender import authoring, checking, light_repair
from ..vlm_addon.blender.interface import availability
from ..vlm_addon.blender.long_operator import LongOperator


class VLM_OT_fix_findings(LongOperator, Operator):  # noqa: N801 (Blender's naming of classes)
    """Mend what the last check has found: move lights behind their surface, turn them over, tag thin bodies. It takes \
as long as a check for each kind"""

    bl_idname = "vlm.fix_findings"
    bl_label = "Fix"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    kind: bpy.props.StringProperty(
        name="Kind",
        description="Kind of the findings to mend, as Check names it; empty: all but what an artist may want",
    )

    @classmethod
    def poll(cls, context):
        return authoring.allow(cls, availability.check_problem(context))

    def prepare(self, context):
        self._left = light_repair.kinds_to_fix(context.scene, self.kind)
        return light_repair.work_on(context, self._left.pop(0))

    def finish(self, context, result):
        if isinstance(result, checking.Checked):
            checking.list_checked(result)
            return None
        told = light_repair.write_fixed(context, result)
        if told:
            self.report({"INFO"}, told)
            self.keep_what_is_written()
        more = light_repair.work_after(context, result)
        if more is None:
            more = light_repair.work_on(context, self._left.pop(0)) if self._left else checking.check(context)
        return more
