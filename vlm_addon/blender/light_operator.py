# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators that change values of lights share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..core.errors import VlmError
from .authoring import allow, lights
from .interface.availability import light_faces_problem
from .light_meshes import chosen_light_meshes


class LightOperator:
    """Mixin of bpy.types.Operator for one change of the chosen light meshes together.

    Chosen are the light meshes in edit mode, or those selected in object mode.
    """

    report: Callable[[set[str], str], None]

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether there are lights to change."""
        return allow(cls, light_faces_problem(context))

    def change_all(self, context: Any, things: Sequence[Any]) -> int:
        """Change the light meshes `things`; returns how many lights changed. Raises VlmError before the first one."""
        raise NotImplementedError

    def execute(self, context: Any) -> set[str]:
        """`change_all` of the chosen light meshes, and a report with the number of lights."""
        try:
            changed = self.change_all(context, chosen_light_meshes(context))
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not changed:
            self.report({"WARNING"}, "No light was changed: select faces of the light mesh")
            return {"CANCELLED"}
        self.report({"INFO"}, f"Changed {lights(changed)}")
        return {"FINISHED"}
