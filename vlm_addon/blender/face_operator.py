# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators that change values of lights share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..core.errors import VlmError
from .authoring import allow, lights
from .availability import light_faces_problem
from .light_faces import Bool, chosen_faces
from .light_meshes import chosen_light_meshes, require_editable


class FaceOperator:
    """Mixin of bpy.types.Operator for one change of the chosen lights.

    Chosen are the selected faces of the light meshes in edit mode, or all faces of those selected in object mode. All
    light meshes are asked whether they can be changed before the first one is.
    """

    report: Callable[[set[str], str], None]

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether there are lights to change."""
        return allow(cls, light_faces_problem(context))

    def change(self, context: Any, thing: Any, chosen: Bool) -> int:
        """Change the faces `chosen` of one light mesh; returns how many changed. Raises VlmError."""
        raise NotImplementedError

    def execute(self, context: Any) -> set[str]:
        """`change` of each chosen light mesh, and a report with the number of lights."""
        things = chosen_light_meshes(context)
        try:
            for thing in things:
                require_editable(thing)
            changed = sum(self.change(context, thing, chosen_faces(thing)) for thing in things)
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not changed:
            self.report({"WARNING"}, "No light was changed: select faces of the light mesh")
            return {"CANCELLED"}
        self.report({"INFO"}, f"Changed {lights(changed)}")
        return {"FINISHED"}
