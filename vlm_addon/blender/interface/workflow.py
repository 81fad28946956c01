# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators in the order of the work, which the sidebar, the menu and the search share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Button:
    """An operator by its name, with an icon of Blender's."""

    operator: str
    icon: str


@dataclass(frozen=True)
class Step:
    """One step of the work. label: of its panel and its menu."""

    name: str
    label: str
    buttons: tuple[Button, ...]


def _buttons(*pairs: tuple[str, str]) -> tuple[Button, ...]:
    return tuple(Button(f"vlm.{name}", icon) for name, icon in pairs)


CREATE = Step(
    "create",
    "Create",
    _buttons(
        ("light_scene", "LIGHT_SUN"),
        ("create_from_selection", "RESTRICT_SELECT_OFF"),
        ("create_from_collection", "OUTLINER_COLLECTION"),
        ("create_from_scene", "SCENE_DATA"),
        ("create_again", "FILE_REFRESH"),
    ),
)
DETAIL = Step(
    "detail",
    "Detail",
    _buttons(("paint_detail", "WPAINT_HLT"), ("lock_lights", "LOCKED"), ("unlock_lights", "UNLOCKED")),
)
DRAW = Step("draw", "Draw", _buttons(("draw_fill", "FACESEL")))
COLOR = Step(
    "color",
    "Color",
    _buttons(
        ("pick_color", "EYEDROPPER"),
        ("fill_color", "BRUSH_DATA"),
        ("multiply_color", "ADD"),
        ("shift_hue", "COLOR"),
        ("gradient_color", "IPO_LINEAR"),
        ("recolor_from_materials", "MATERIAL"),
        ("set_strength", "LIGHT"),
    ),
)
TAGS = Step(
    "tags",
    "Tags",
    _buttons(
        ("assign_tag", "BOOKMARKS"),
        ("clear_tag", "X"),
        ("pair_tags", "LINKED"),
        ("tag_thin", "MOD_THICKNESS"),
        ("repair_tags", "TOOL_SETTINGS"),
        ("link_receiver", "UNLINKED"),
        ("unlink_receiver", "LINK_BLEND"),
    ),
)
CHECK = Step("check", "Check", _buttons(("check", "CHECKMARK"), ("fix_findings", "TOOL_SETTINGS")))
ANIMATE = Step("animate", "Animate", _buttons(("follow_source", "CON_FOLLOWTRACK"), ("stop_following", "UNLINKED")))
BAKE = Step(
    "bake",
    "Bake",
    _buttons(
        ("bake", "FILE_REFRESH"),
        ("bake_grid", "LIGHTPROBE_VOLUME"),
        ("check_bake", "ZOOM_ALL"),
        ("clear_bake", "TRASH"),
    ),
)
VIEW = Step("view", "View", _buttons(("show_light_grid", "LIGHTPROBE_VOLUME")))
SUPPORT = Step(
    "support",
    "Support",
    _buttons(("open_documentation", "HELP"), ("copy_diagnostics", "COPYDOWN"), ("show_licences", "TEXT")),
)

STEPS = (CREATE, DETAIL, DRAW, COLOR, TAGS, CHECK, ANIMATE, BAKE, VIEW, SUPPORT)

ELSEWHERE = (
    "vlm.add_preset",
    "vlm.draw_cut",
    "vlm.draw_erase",
    "vlm.draw_extrude",
    "vlm.draw_key",
    "vlm.draw_polygon",
    "vlm.draw_rectangle",
    "vlm.select_offenders",
)
"""Operators that tools, presets and the list of findings start."""

PIE = (
    "vlm.create_from_selection",
    "vlm.check",
    "vlm.pick_color",
    "vlm.fill_color",
    "vlm.multiply_color",
    "vlm.assign_tag",
    "vlm.draw_fill",
    "vlm.light_scene",
)
"""In the order in which Blender fills a pie: left, right, bottom, top, then the corners."""


def button(operator: str) -> Button:
    """The button of an operator that a step has. Raises KeyError for another."""
    return {each.operator: each for step in STEPS for each in step.buttons}[operator]
