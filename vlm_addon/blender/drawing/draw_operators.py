# SPDX-License-Identifier: GPL-3.0-or-later
"""What the drawing operators share: properties that keep a stroke for redo, and how they are carried out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ...core.errors import VlmError
from ..light_meshes import is_local
from ..names import is_light_mesh
from .draw_fill import fill_sources

POINTS = 'in world space, meters, as "x y z, x y z"'


class Carried:
    """Mixin of bpy.types.Operator whose `carry_out` does all at once."""

    report: Callable[[set[str], str], None]

    def carry_out(self, context: Any) -> str:
        """Change the light meshes; returns a sentence with counts. Raises VlmError with nothing changed."""
        raise NotImplementedError

    def execute(self, context: Any) -> set[str]:
        """`carry_out` and a report of what came of it."""
        try:
            self.report({"INFO"}, self.carry_out(context))
        except VlmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class Stroke(Carried):
    """Tools that make something of points on surfaces."""

    points: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Points", description=f"Points of the stroke {POINTS}", options={"HIDDEN", "SKIP_SAVE"}
    )
    normals: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Normals",
        description="Directions that the surface faces in at the points, one for all or one for each; none: the side "
        "from which the points run anticlockwise, or either side",
        options={"HIDDEN", "SKIP_SAVE"},
    )


class NewLights(Carried):
    """Tools that make lights."""

    target: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Light Mesh",
        description="Name of the light mesh that gets the lights; none for the active one, or else a new one",
        options={"SKIP_SAVE"},
    )


class NewLightsStroke(NewLights, Stroke):
    """Tools that make lights of points on surfaces."""

    offset: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Offset",
        description="How far behind the surface lights lie, beyond what keeps them from lighting it",
        default=0.0,
        min=0.0,
        soft_max=0.1,
        unit="LENGTH",
        precision=4,
    )


def draw_problem(context: Any) -> str | None:
    """Why nothing can be drawn here, or None."""
    active = context.active_object
    if context.mode not in ("OBJECT", "EDIT_MESH"):
        return "Leave this mode first: lights are drawn in Object Mode, or in Edit Mode of a light mesh"
    if context.mode == "EDIT_MESH" and not is_light_mesh(active):
        return "Leave Edit Mode (Tab), or edit a light mesh: drawn lights go into light meshes"
    if active is not None and is_light_mesh(active) and not is_local(active):
        return f"{active.name} is linked from another file: make it local first, or make another object active"
    if context.scene.library is not None:
        return f"The scene is linked from {context.scene.library.filepath}: open that file, or make the scene local"
    return None


def fill_problem(context: Any) -> str | None:
    """Why there are no faces to fill, or None."""
    if context.mode not in ("OBJECT", "EDIT_MESH"):
        return "Leave this mode first: faces are filled in Object Mode or Edit Mode"
    if not fill_sources(context):
        return "Select a visible mesh, and faces of it in Edit Mode: each becomes a light"
    return None
