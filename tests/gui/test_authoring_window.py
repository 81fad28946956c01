# SPDX-License-Identifier: GPL-3.0-or-later
"""Every button of the sidebar pressed with the mouse in the window: drive_authoring.py presses, the tests read on.

Blender is found as blender_window.py says.
"""

import pytest

from tests.gui.blender_window import assert_ended_well
from vlm_addon.blender.interface.workflow import ELSEWHERE, STEPS

pytestmark = pytest.mark.full

DRIVER = "authoring"
MINUTES = 20
SCREEN = (1000, 2300)
"""So high that the whole sidebar is shown."""
DRAWN = {"draw_cut", "draw_erase", "draw_extrude", "draw_key", "draw_polygon", "draw_rectangle"}
"""Operators of the tools and of their keys: drive_drawing.py draws with them."""
OPERATORS = [button.operator.removeprefix("vlm.") for step in STEPS for button in step.buttons]


def presses(story, name=None):
    """What came of the presses, by situation and operator; of one operator alone where it is named."""
    found = story["pressed"].items()
    return {where: told for where, told in found if name is None or where.split(": ")[1] == name}


def test_the_story_came_to_its_end_and_nothing_was_raised_on_the_way(story):
    assert_ended_well(story)


@pytest.mark.parametrize("name", OPERATORS)
def test_the_button_of_each_operator_runs_it_and_no_other(story, name):
    """By what Blender says of the operator that ended last."""
    assert presses(story, name)
    assert {told["did"] for told in presses(story, name).values()} == {f"VLM_OT_{name}"}


def test_every_button_worked_in_some_situation(story):
    shown = {name for names in story["buttons"].values() for name in names}
    assert shown >= set(OPERATORS) - {"paint_detail"}, "what has a menu gives no command"
    worked = {where.split(": ")[1] for where, told in presses(story).items() if told["did"]}
    assert shown <= worked


def test_ctrl_z_takes_each_press_back_and_redo_brings_it_again(story):
    pressed = {where: told for where, told in presses(story).items() if "undone" in told}
    assert len(pressed) >= len(OPERATORS) - len(story["not undone"])
    assert not [where for where, told in pressed.items() if not told["changed"]]
    assert not [where for where, told in pressed.items() if not told["undone"] or not told["undone again"]]
    assert not [where for where, told in pressed.items() if not told["redone"]]


def test_no_button_needs_esc_to_end(story):
    assert not [press for press, told in presses(story).items() if told["Esc"]]


def test_what_has_no_undo_step_changes_nothing_of_the_file(story):
    told = {name: list(presses(story, name).values()) for name in story["not undone"]}
    assert all(told.values())
    assert not [name for name, each in told.items() if any(press["changed"] for press in each)]


def test_the_sidebar_offers_what_the_selection_can_use(story):
    buttons = story["buttons"]
    assert "create_from_selection" in buttons["objects selected"]
    assert {"fill_color", "check"} <= set(buttons["lights selected"])
    assert "fill_color" in buttons["lights edited"]


def test_the_pie_menu_and_the_search_start_operators(story):
    assert story["pie"] == ["VLM_OT_fill_color"]
    assert story["search"] == ["VLM_OT_gradient_color"]


def test_the_manual_is_opened(story):
    assert story["opened"]


def test_leaving_out_asks_for_an_object_where_none_is_selected(story):
    assert story["by name"]["did"] == "VLM_OT_link_receiver"


def test_the_menu_of_presets_adds_one(story):
    assert story["preset"] == ["VLM_OT_add_preset"]


def test_what_has_no_button_of_its_own_is_driven_too(story):
    elsewhere = {name.removeprefix("vlm.") for name in ELSEWHERE}
    assert elsewhere == DRAWN | {"add_preset", "select_offenders"}
    assert {told["did"] for told in presses(story, "select_offenders").values()} == {"VLM_OT_select_offenders"}
