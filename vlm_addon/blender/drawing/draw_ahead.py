# SPDX-License-Identifier: GPL-3.0-or-later
"""What the first stroke on a surface needs is made ready while the mouse rests over it with a drawing tool chosen.

Blender builds the tree of a mesh at the first ray, and a picture takes longer to read than a stroke. A timer does one
after another, so that Blender handles events in between; what needs no Blender data is done in a thread. A stroke that
comes before the end reads what is missing by itself.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import bpy

from ...core.brdf import albedo_table
from ..background_work import BackgroundWork
from ..extraction.kept_materials import material_reader
from .draw_surfaces import hits_along
from .draw_view import View, view_under

SECONDS_OF_REST = 0.1
"""For so long the mouse does not move before anything is read."""


@dataclass
class _Ahead:
    """mouse: address of the 3D view under it, and pixel of the window. heard: seconds of time.monotonic(). is_new:
    whether nothing was read there. slots: (object, material slot) that are yet to be read."""

    mouse: tuple[int, int, int] = (0, 0, 0)
    heard: float = 0.0
    is_new: bool = False
    slots: list[tuple[tuple[str, str | None], int]] = field(default_factory=list)


_AHEAD = _Ahead()
"""Blender calls the timer without any object that could hold it."""


def mouse_is_at(context: Any, x: float, y: float) -> None:
    """Hear where in the window the mouse is with a drawing tool; called whenever the cursor is drawn."""
    mouse = (0 if context.area is None else context.area.as_pointer(), int(x), int(y))
    if mouse == _AHEAD.mouse or context.area is None:
        return
    _AHEAD.mouse, _AHEAD.heard, _AHEAD.is_new = mouse, time.monotonic(), True
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=SECONDS_OF_REST)


def register(undo: ExitStack) -> None:
    """`undo` hears how to stop what is under way."""
    undo.callback(_stop)


def _stop() -> None:
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _AHEAD.slots, _AHEAD.is_new = [], False


def _tick() -> float | None:
    """One of the things that are to be done; seconds until the next, None when nothing is left."""
    rest = SECONDS_OF_REST - (time.monotonic() - _AHEAD.heard)
    if _AHEAD.is_new and rest > 0.0:
        return rest
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.as_pointer() == _AHEAD.mouse[0] and area.type == "VIEW_3D":
                with bpy.context.temp_override(window=window, area=area):
                    _step(bpy.context, area)
                return 0.0 if _AHEAD.slots else None
    _AHEAD.slots = []
    return None


def _step(context: Any, area: Any) -> None:
    depsgraph = context.evaluated_depsgraph_get()
    if not _AHEAD.is_new:
        read_slot(depsgraph, *_AHEAD.slots.pop(0))
        return
    _AHEAD.is_new = False
    found = view_under(area, *_AHEAD.mouse[1:])
    _AHEAD.slots = [] if found is None else look(context.scene, depsgraph, *found)


def look(scene: Any, depsgraph: Any, view: View, pixel: Any) -> list[tuple[tuple[str, str | None], int]]:
    """The material slots of what shows at a pixel; from now on rays there are quick."""
    BackgroundWork(lambda _: albedo_table())
    origin, direction, length = view.ray(pixel)
    hit = next(hits_along(scene, depsgraph, origin, direction, length), None)
    thing = None if hit is None else bpy.data.objects.get(hit.key)
    return [] if hit is None or thing is None else [(hit.key, slot) for slot in range(len(thing.material_slots))]


def read_slot(depsgraph: Any, key: tuple[str, str | None], slot: int) -> None:
    """Read the material in a slot of an object, where they are still there; its pictures are halved in a thread."""
    thing = bpy.data.objects.get(key)
    if thing is None or slot >= len(thing.material_slots):
        return
    reader = material_reader(depsgraph)
    reader.read_material(thing.evaluated_get(depsgraph).material_slots[slot].material)
    BackgroundWork(lambda _: reader.halve_pictures())
