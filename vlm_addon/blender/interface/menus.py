# SPDX-License-Identifier: GPL-3.0-or-later
"""Every operator in a menu, so that Blender's search finds it, and the most used ones in a pie."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import bpy

from .translation import OWN_CONTEXT
from .workflow import PIE, STEPS, Step, button

MENU, PIE_MENU = "VLM_MT_main", "VLM_MT_pie"
MENUS = ("VIEW3D_MT_object", "VIEW3D_MT_edit_mesh")
"""Blender's menus that ours hangs in."""
PIE_KEY = {"type": "V", "value": "PRESS", "shift": True, "alt": True}
WITH_MENU = {"vlm.paint_detail": "group"}
"""Operators that ask for a choice first, and the property that it is."""


def _draw_step(step: Step) -> Any:
    def draw(self: Any, context: Any) -> None:
        # the menu runs operators with their dialogs and modal forms
        self.layout.operator_context = "INVOKE_DEFAULT"
        for each in step.buttons:
            if each.operator in WITH_MENU:
                self.layout.operator_menu_enum(each.operator, WITH_MENU[each.operator], icon=each.icon)
            else:
                self.layout.operator(each.operator, icon=each.icon)

    return draw


def _step_menu(step: Step) -> type:
    members = {"bl_label": step.label, "bl_translation_context": OWN_CONTEXT, "draw": _draw_step(step)}
    return type(f"VLM_MT_{step.name}", (bpy.types.Menu,), members)


class VLM_MT_main(bpy.types.Menu):  # noqa: N801 (Blender's naming of classes)
    """All steps of the work."""

    bl_label = "Virtual Light Mesh"

    def draw(self, context: Any) -> None:
        """A menu for each step."""
        for step in STEPS:
            self.layout.menu(f"VLM_MT_{step.name}")


class VLM_MT_pie(bpy.types.Menu):  # noqa: N801
    """What is used most."""

    bl_label = "Virtual Light Mesh"

    def draw(self, context: Any) -> None:
        """Eight buttons around the mouse."""
        pie = self.layout.menu_pie()
        pie.operator_context = "INVOKE_DEFAULT"
        for name in PIE:
            pie.operator(name, icon=button(name).icon)


def _draw_in_menu(self: Any, context: Any) -> None:
    self.layout.separator()
    self.layout.menu(MENU, icon="LIGHT_AREA")


def register(undo: ExitStack) -> None:
    """Add the menus and the pie's key; `undo` hears how to take them away."""
    for cls in (*map(_step_menu, STEPS), VLM_MT_main, VLM_MT_pie):
        bpy.utils.register_class(cls)
        undo.callback(bpy.utils.unregister_class, cls)
    for name in MENUS:
        menu = getattr(bpy.types, name)
        menu.append(_draw_in_menu)
        undo.callback(menu.remove, _draw_in_menu)
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is None:  # in background there are no keys
        return
    keymap = keys.keymaps.new(name="3D View", space_type="VIEW_3D")
    item = keymap.keymap_items.new("wm.call_menu_pie", **PIE_KEY)
    item.properties.name = PIE_MENU
    undo.callback(keymap.keymap_items.remove, item)
