# SPDX-License-Identifier: GPL-3.0-or-later
"""A stroke in the window: points are collected, snapped and shown; `execute` then does what a script would do.

Nothing of the file changes before the stroke is finished, so cancelling restores all, and each stroke is one undo step.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import bpy
import numpy as np

from ...core.brdf import albedo_table
from ...core.counting import counted
from ...core.scene import Float64
from ..background_work import BackgroundWork
from ..names import is_light_mesh
from . import draw_preview
from .draw_keys import CANCEL, FINISH, REMOVE, SNAP, Keys, read_keys
from .draw_mesh import vertices_world
from .draw_points import text_of
from .draw_preview import DRAW_COLOR, Preview
from .draw_snap import SNAP_PIXELS, Place, place_under
from .draw_view import view_under

DRAG_PIXELS = 8.0
MARK_PIXELS = 5.0
MOVES = ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE")
RUNNING, CANCELLED = {"RUNNING_MODAL"}, {"CANCELLED"}


class ModalStroke:
    """Mixin of bpy.types.Operator with properties `points` and `normals` and an `execute` that needs no more.

    Subclasses say when the stroke is at its end, what it looks like and what is kept of it.
    """

    snap: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Snap",
        description="Points go to vertices of lights, and to vertices and edges of the face under the mouse",
        default=True,
    )
    report: Callable[[set[str], str], None]
    execute: Callable[[Any], set[str]]
    title = ""
    color = DRAW_COLOR
    least_points = 1
    most_points = 0
    """The stroke ends with so many points; 0 for any number."""
    is_freehand = False
    """Whether points are collected while the mouse is dragged."""
    ends_on_click = False
    """Whether a click is a whole stroke; a drag from the first point always is."""

    def shape(self, places: list[Place]) -> list[Float64]:
        """Ways that show what the stroke would make of `places`, (n, 3) each."""
        return [np.array([place.location for place in places])]

    def status(self, places: list[Place]) -> str:
        """What the header says of the stroke so far."""
        return counted(len(places), "point")

    def closes(self, places: list[Place], place: Place) -> bool:
        """Whether a click at `place` ends the stroke."""
        return False

    def begin(self, context: Any, place: Place) -> str | None:
        """Why the stroke cannot begin at `place`, or None."""
        return None

    def store(self, places: list[Place], dragged: bool) -> None:
        """Put the stroke into the properties."""
        self.points = text_of(np.array([place.location for place in places]))
        self.normals = text_of(np.array([place.normal for place in places]))

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start a stroke; carry out at once what has its points already."""
        if self.points or context.area is None or context.area.type != "VIEW_3D":
            return self.execute(context)
        self._places: list[Place] = []
        self._over: Place | None = None
        # A table that all glossy materials share takes most of a second; the stroke takes longer.
        self._warming = BackgroundWork(lambda _: albedo_table())
        self._keys: Keys = read_keys(context)
        self._held = False
        self._dragged = False
        self._inverted = False
        self._pressed_at = np.zeros(2)
        self._button = event.type if event.value == "PRESS" and event.type.endswith("MOUSE") else "LEFTMOUSE"
        active = context.active_object
        own = active is not None and active.type == "MESH" and is_light_mesh(active)
        self._vertices = vertices_world(active) if own else np.zeros((0, 3))
        self._preview = Preview(color=self.color)
        self._handle = draw_preview.show(self._preview)
        if self.modal(context, event) == CANCELLED:
            return CANCELLED
        # Only now: Blender would keep a handler of a stroke that has ended.
        context.window_manager.modal_handler_add(self)
        return RUNNING

    def modal(self, context: Any, event: Any) -> set[str]:
        """One event; whatever ends the stroke takes its lines and texts away."""
        with ExitStack() as undo:
            undo.callback(self._clean_up, context)
            result = self._handled(context, event)
            if result & {"RUNNING_MODAL", "PASS_THROUGH"}:
                undo.pop_all()
        return result

    def cancel(self, context: Any) -> None:
        """Blender ends the stroke: another file is loaded, or the window closes."""
        self._clean_up(context)

    def _handled(self, context: Any, event: Any) -> set[str]:
        if context.area is None:
            return CANCELLED  # the view was closed or another workspace shown
        action = self._keys.action(event)
        if action == SNAP:
            self._inverted = event.value == "PRESS"
            return RUNNING
        if action == CANCEL:
            return CANCELLED
        if action == FINISH:
            return self._finish(context)
        if action == REMOVE:
            return self._remove(context)
        if self._keys.is_passed(event):
            return {"PASS_THROUGH"}
        if event.type in MOVES:
            self._move(context, event)
        elif event.type == self._button and event.value in ("PRESS", "DOUBLE_CLICK"):
            return self._press(context, event)
        elif event.type == self._button and event.value == "RELEASE":
            return self._release(context, event)
        return RUNNING

    def _move(self, context: Any, event: Any) -> None:
        self._look(context, event)
        place = self._over
        if self._held and place is not None and (self._dragged or len(self._places) == 1):
            self._dragged = self._dragged or _apart(place.pixel, self._pressed_at) > DRAG_PIXELS
            if self._dragged and self.is_freehand and _apart(place.pixel, self._places[-1].pixel) >= DRAG_PIXELS:
                self._places.append(place)
        self._show(context)

    def _press(self, context: Any, event: Any) -> set[str]:
        self._look(context, event)
        place = self._over
        if place is None:
            self._show(context)
            return RUNNING if self._places else CANCELLED
        problem = None if self._places else self.begin(context, place)
        if problem is not None:
            self.report({"WARNING"}, problem)
            return CANCELLED
        self._held, self._pressed_at = True, place.pixel
        if event.value == "DOUBLE_CLICK" or self.closes(self._places, place):
            return self._finish(context)
        self._places.append(place)
        if len(self._places) == self.most_points:
            return self._finish(context)
        self._show(context)
        return RUNNING

    def _release(self, context: Any, event: Any) -> set[str]:
        was_held, self._held = self._held, False
        if not was_held or not (self._dragged or self.ends_on_click):
            return RUNNING
        self._look(context, event)
        if self._over is not None and _apart(self._over.pixel, self._places[-1].pixel) > 0.0:
            self._places.append(self._over)
        return self._finish(context)

    def _remove(self, context: Any) -> set[str]:
        if not self._places:
            return CANCELLED
        self._places.pop()
        self._show(context)
        return RUNNING

    def _finish(self, context: Any) -> set[str]:
        if len(self._places) < self.least_points:
            self.report({"WARNING"}, f"Nothing done: {len(self._places)} of at least {self.least_points} points")
            return CANCELLED
        self.store(self._places, self._dragged)
        return self.execute(context)

    def _look(self, context: Any, event: Any) -> None:
        """Where the mouse is; the surface that was there last stays while it leaves the view."""
        found = view_under(context.area, event.mouse_x, event.mouse_y)
        if found is None:
            return
        view, pixel = found
        self._view = view
        depsgraph = context.evaluated_depsgraph_get()
        snap = self.snap != self._inverted and not (self._dragged and self.is_freehand)
        self._over = place_under(context.scene, depsgraph, view, pixel, self._vertices, snap)
        self._preview.mark = []
        if self._over is not None and self._over.what:
            self._preview.mark = [_mark(self._over, view.metres_per_pixel(self._over.location))]

    def _show(self, context: Any) -> None:
        """Lines, header and status bar."""
        places = self._places if self._over is None else [*self._places, self._over]
        self._preview.lines = self.shape(places) if places else []
        snapped = f"  ·  at {self._over.what}" if self._over is not None and self._over.what else ""
        text = self.status(places) if self._over is not None else "no surface under the mouse"
        context.area.header_text_set(f"{self.title}: {text}{snapped}")
        names = {CANCEL: "Cancel", REMOVE: "Remove last point", FINISH: "Finish", SNAP: "Snap on or off (hold)"}
        hints = [f"{self._keys.texts[action]}: {name}" for action, name in names.items() if action in self._keys.texts]
        context.workspace.status_text_set("   ".join(hints))
        context.area.tag_redraw()

    def _clean_up(self, context: Any) -> None:
        draw_preview.hide(self._handle)
        if context.area is not None:
            context.area.header_text_set(None)
            context.area.tag_redraw()
        if context.workspace is not None:
            context.workspace.status_text_set(None)


def _mark(place: Place, metres_per_pixel: float) -> Float64:
    """A small square in the surface around a point."""
    side, other = in_surface(place.normal)
    corners = np.array([side + other, other - side, -side - other, side - other, side + other])
    mark: Float64 = place.location + MARK_PIXELS * metres_per_pixel * corners
    return mark


def in_surface(normal: Float64) -> tuple[Float64, Float64]:
    """Two unit vectors in a surface, at right angles to its unit normal and to each other."""
    side = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    side /= np.linalg.norm(side)
    return side, np.cross(normal, side)


def near_in_view(place: Place, other: Place) -> bool:
    """Whether two points of a stroke show at one place."""
    return _apart(place.pixel, other.pixel) <= SNAP_PIXELS


def _apart(pixel: Float64, other: Float64) -> float:
    return float(np.linalg.norm(pixel - other))
