# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators that change values of lights share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..core.errors import VlmError
from .authoring import allow, lights
from .interface.availability import light_faces_problem
from .light_colors import one_per_mesh
from .light_faces import Bool, chosen_faces
from .light_meshes import chosen_light_meshes, require_editable


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


class FaceOperator(LightOperator):
    """Mixin of bpy.types.Operator for a change that each light mesh can take by itself.

    Chosen are the selected faces of the light meshes in edit mode, or all faces of those selected in object mode. All
    light meshes are asked whether they can be changed before the first one is; a mesh that objects share changes once.
    """

    def change(self, context: Any, thing: Any, chosen: Bool) -> int:
        """Change the faces `chosen` of one light mesh; returns how many changed. Raises VlmError."""
        raise NotImplementedError

    def change_all(self, context: Any, things: Sequence[Any]) -> int:
        """`change` of each."""
        for thing in things:
            require_editable(thing)
        return sum(self.change(context, thing, chosen_faces(thing)) for thing in one_per_mesh(things))
