# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension adds to Blender, and takes out again in reverse order."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack

import bpy

from . import authoring, cli_commands, engine, long_operator, migration
from .baking import bake_state
from .drawing import draw_tool
from .interface import engine_panels, menus, panels, properties, render_panels, setting_presets, translation
from .overlays import overlays
from .render_process import KEPT

PARTS = (migration, bake_state, draw_tool, setting_presets, menus, translation, overlays, long_operator)
"""Modules with a `register(undo: ExitStack)`, in order."""

_REGISTERED = ExitStack()
"""What `unregister` has to undo; Blender calls the two functions without any object between them."""


def register(operator_classes: Iterable[type]) -> None:
    """Add classes, scene settings, the render engine with its panels and the command line.

    Where one step fails, those before it are undone and the exception passes on.
    """
    with ExitStack() as undo:
        undo.callback(KEPT.close)
        undo.callback(_stop_timer)
        properties.register_scene_settings(undo)
        for cls in (
            *operator_classes,
            *panels.CLASSES,
            *render_panels.CLASSES,
            *panels.LAST_CLASSES,
            engine.VLM_RenderEngine,
        ):
            bpy.utils.register_class(cls)
            undo.callback(bpy.utils.unregister_class, cls)
        for part in PARTS:
            part.register(undo)
        engine_panels.register()
        undo.callback(engine_panels.unregister)
        handle = cli_commands.register()
        undo.callback(cli_commands.unregister, handle)
        _REGISTERED.push(undo.pop_all())


def unregister() -> None:
    """Take out all that `register` added and end the renderer's process."""
    _REGISTERED.close()


def _stop_timer() -> None:
    if bpy.app.timers.is_registered(authoring.render_in_window):
        bpy.app.timers.unregister(authoring.render_in_window)
