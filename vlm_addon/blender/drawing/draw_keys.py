# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys while a stroke is drawn, taken from the user's keymaps, so that they can be changed in the preferences."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import bpy

FINISH, REMOVE, CANCEL, SNAP = "FINISH", "REMOVE", "CANCEL", "SNAP"
ACTIONS = (
    (FINISH, "Finish", "Make lights of what is drawn"),
    (REMOVE, "Remove Last Point", "Take the last point back"),
    (CANCEL, "Cancel", "Draw nothing"),
    (SNAP, "Snap (hold)", "Snap where it is off, and do not where it is on"),
)
KEY_OPERATOR = "vlm.draw_key"
DEFAULT_KEYS = (
    ("RET", FINISH),
    ("NUMPAD_ENTER", FINISH),
    ("BACK_SPACE", REMOVE),
    ("ESC", CANCEL),
    ("RIGHTMOUSE", CANCEL),
    ("LEFT_CTRL", SNAP),
)
KEYMAP = "3D View"
UNDO = ("Screen", "ed.undo")
"""The user's key for undo takes back the last point."""

PASSED = (
    ("3D View", ("view3d.view", "view3d.zoom", "view3d.rotate", "view3d.move", "view3d.dolly", "view3d.ndof")),
    ("3D View", ("view3d.walk", "view3d.fly", "view3d.navigate", "view3d.smoothview")),
    ("Window", ("wm.save_mainfile", "wm.save_as_mainfile")),
    ("Screen", ("screen.screen_full_area", "screen.screenshot")),
)
"""What goes on working while a stroke is drawn: beginnings of operators' names, by keymap."""

BLENDERS = ("TIMER", "WINDOW_DEACTIVATE", "NDOF_MOTION", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "MOUSESMARTZOOM")
"""Events without a key that are Blender's."""

WHEEL = {"WHEELINMOUSE": ("WHEELUPMOUSE", "WHEELDOWNMOUSE"), "WHEELOUTMOUSE": ("WHEELUPMOUSE", "WHEELDOWNMOUSE")}
"""Keymaps say in and out, events up and down; which is which is a preference."""


@dataclass(frozen=True)
class _Key:
    type: str
    shift: bool
    ctrl: bool
    alt: bool
    oskey: bool
    any: bool

    def is_pressed(self, event: Any) -> bool:
        alike = (event.shift, event.ctrl, event.alt, event.oskey) == (self.shift, self.ctrl, self.alt, self.oskey)
        return event.type in WHEEL.get(self.type, (self.type,)) and (self.any or alike)


@dataclass(frozen=True)
class Keys:
    """actions: key and action; passed: keys that stay Blender's; texts: name of the first key by action."""

    actions: tuple[tuple[_Key, str], ...]
    passed: tuple[_Key, ...]
    texts: dict[str, str]

    def action(self, event: Any) -> str:
        """One of ACTIONS for a press, SNAP for press and release, or ""."""
        for key, action in self.actions:
            if event.type == key.type and (action == SNAP or (event.value == "PRESS" and key.is_pressed(event))):
                return action
        return ""

    def is_passed(self, event: Any) -> bool:
        """Whether the event is one that Blender shall have: navigation and saving."""
        return event.type in BLENDERS or any(key.is_pressed(event) for key in self.passed)


def read_keys(context: Any) -> Keys:
    """The keys as the user has set them."""
    keymaps = context.window_manager.keyconfigs.user.keymaps
    own = [(item, item.properties.action) for item in _items(keymaps, KEYMAP, (KEY_OPERATOR,))]
    actions = [(_key(item), action) for item, action in own]
    actions += [(_key(item), REMOVE) for item in _items(keymaps, UNDO[0], UNDO[1:])]
    texts: dict[str, str] = {}
    # Blender lists what was added last first.
    for item, action in reversed(own):
        texts.setdefault(action, item.to_string())
    passed = [_key(item) for name, starts in PASSED for item in _items(keymaps, name, starts)]
    return Keys(tuple(actions), tuple(passed), texts)


def _items(keymaps: Any, name: str, starts: tuple[str, ...]) -> list[Any]:
    keymap = keymaps.get(name)
    return (
        []
        if keymap is None
        else [each for each in keymap.keymap_items if each.active and each.idname.startswith(starts)]
    )


def _key(item: Any) -> _Key:
    return _Key(item.type, bool(item.shift), bool(item.ctrl), bool(item.alt), bool(item.oskey), bool(item.any))


def register_keys(undo: ExitStack) -> None:
    """Add the default keys to Blender's keymaps of add-ons; there are none in background."""
    config = bpy.context.window_manager.keyconfigs.addon
    if config is None:
        return
    keymap = config.keymaps.new(name=KEYMAP, space_type="VIEW_3D")
    for key, action in DEFAULT_KEYS:
        item = keymap.keymap_items.new(KEY_OPERATOR, key, "PRESS")
        item.properties.action = action
        undo.callback(keymap.keymap_items.remove, item)
