# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension adds to Blender, and takes out again in reverse order."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any

import bpy

from . import authoring, cli_commands, engine, engine_panels, panels, properties
from .render_process import KEPT

_REGISTERED = ExitStack()
"""What `unregister` has to undo; Blender calls the two functions without any object between them."""


def register(operator_classes: Iterable[type]) -> None:
    """Add classes, scene settings, the render engine with its panels and the command line.

    Where one step fails, those before it are undone and the exception passes on.
    """
    with ExitStack() as undo:
        undo.callback(KEPT.close)
        undo.callback(_stop_timer)
        scene_classes = properties.scene_property_classes()
        for cls in (*scene_classes, *operator_classes, *panels.CLASSES, engine.VLM_RenderEngine):
            bpy.utils.register_class(cls)
            undo.callback(bpy.utils.unregister_class, cls)
        _add_scene_settings(scene_classes[-1])
        undo.callback(delattr, bpy.types.Scene, properties.SCENE_PROPERTY)
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


def _add_scene_settings(group: Any) -> None:
    pointer = bpy.props.PointerProperty(type=group, name="Virtual Light Mesh")
    setattr(bpy.types.Scene, properties.SCENE_PROPERTY, pointer)
