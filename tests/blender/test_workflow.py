# SPDX-License-Identifier: GPL-3.0-or-later
"""Every operator has its place in the sidebar, the menu and so in Blender's search."""

from pathlib import Path

import bpy

from vlm_addon.blender.drawing.draw_keys import KEY_OPERATOR
from vlm_addon.blender.interface.workflow import ELSEWHERE, PIE, STEPS, button

OPERATORS = Path(__file__).resolve().parents[2] / "operators"


def stored_names():
    """Each operator's file is called as the operator is."""
    return {f"vlm.{path.stem}" for path in OPERATORS.glob("*.py") if path.stem != "__init__"}


def test_every_operator_has_just_one_place():
    placed = [each.operator for step in STEPS for each in step.buttons] + list(ELSEWHERE)
    assert sorted(placed) == sorted(stored_names())
    assert KEY_OPERATOR in ELSEWHERE


def test_files_of_operators_are_called_as_the_operators_are():
    for path in OPERATORS.glob("*.py"):
        text = path.read_text()
        if "bl_idname" in text and f"vlm.{path.stem}" != KEY_OPERATOR:
            assert f'bl_idname = "vlm.{path.stem}"' in text


def test_the_pie_holds_eight_operators_that_steps_have():
    assert len({button(name).operator for name in PIE}) == 8


def test_icons_are_blenders():
    known = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items.keys()
    assert {each.icon for step in STEPS for each in step.buttons} <= set(known)
