# SPDX-License-Identifier: GPL-3.0-or-later
"""A click on a visible surface in a 3D view, for tools that ask for a place. Light meshes are clicked through."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from .names import is_light_mesh

PICK = {"LEFTMOUSE"}
STOP = {"ESC", "RIGHTMOUSE"}


def surface_at(context: Any, region: Any, x: float, y: float) -> tuple[Vector, Any] | None:
    """World-space point and object of the visible surface under pixel (x, y) of a 3D view's region, or None."""
    view = region.data
    origin = region_2d_to_origin_3d(region, view, (x, y))
    direction = region_2d_to_vector_3d(region, view, (x, y))
    return surface_along(context.scene, context.evaluated_depsgraph_get(), origin, direction)


def surface_along(scene: Any, depsgraph: Any, origin: Vector, direction: Vector) -> tuple[Vector, Any] | None:
    """World-space point and object of the first surface that a ray meets, or None.

    `Scene.ray_cast` stops at light meshes, which may lie in the very plane of what they stand for, so each object is
    asked by itself, too; an object that is being edited answers to the scene alone. What is disabled in renders
    bounces no light and is passed.
    """
    met = []
    hit, point, _, _, thing, _ = scene.ray_cast(depsgraph, origin, direction)
    if hit and _is_surface(thing):
        met.append((point, thing.original))
    for instance in depsgraph.object_instances:
        thing, matrix = instance.object, instance.matrix_world
        asked = instance.show_self and thing.type == "MESH" and _is_surface(thing)
        if not asked or not matrix.determinant():
            continue
        inverse = matrix.inverted()
        hit, point, _, _ = thing.ray_cast(inverse @ origin, (inverse.to_3x3() @ direction).normalized())
        if hit:
            met.append((matrix @ point, thing.original))
    return min(met, key=lambda each: (each[0] - origin).length, default=None)


def _is_surface(thing: Any) -> bool:
    return not is_light_mesh(thing) and not thing.hide_render


def region_under_mouse(context: Any, event: Any) -> Any | None:
    """The main region of the 3D view under the mouse, or None."""
    for area in context.screen.areas:
        if area.type != "VIEW_3D":
            continue
        for region in reversed(area.regions):
            inside = 0 <= event.mouse_x - region.x < region.width and 0 <= event.mouse_y - region.y < region.height
            if inside and region.width > 1:
                return region if region.type == "WINDOW" else None
    return None


class Eyedropper:
    """Mixin of bpy.types.Operator: `invoke` waits for a click on a surface, `picked` keeps it, `execute` does the rest.

    All other events stay Blender's, so the view can be turned meanwhile; Esc and right click end it.
    """

    execute: Callable[[Any], set[str]]
    report: Callable[[set[str], str], None]
    hint = "Click a surface to take its color; Esc cancels"

    def picked(self, point: Vector, thing: Any) -> None:
        """Keep the place in the operator's properties."""
        raise NotImplementedError

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Wait for a click in the window."""
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(self.hint)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Take the surface under a click; one beside all surfaces says so and waits on."""
        if event.value != "PRESS" or event.type not in PICK | STOP:
            return {"PASS_THROUGH"}
        if event.type in STOP:
            self._stop(context)
            return {"CANCELLED"}
        region = region_under_mouse(context, event)
        if region is None:
            return {"PASS_THROUGH"}
        found = surface_at(context, region, event.mouse_x - region.x, event.mouse_y - region.y)
        if found is None:
            self.report({"WARNING"}, "No visible surface there: click one")
            return {"RUNNING_MODAL"}
        self._stop(context)
        self.picked(*found)
        return self.execute(context)

    def cancel(self, context: Any) -> None:
        """Blender ends the operator: another file is loaded or the window closes."""
        self._stop(context)

    def _stop(self, context: Any) -> None:
        if context.window is not None:
            context.window.cursor_modal_restore()
        if context.workspace is not None:
            context.workspace.status_text_set(None)
