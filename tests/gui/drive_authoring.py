# SPDX-License-Identifier: GPL-3.0-or-later
"""Presses every button of the sidebar with the mouse, each in the situation that it is for, and undoes and redoes it.

Played by test_authoring_window.py; see window_steps.py. STORY: for each operator what came of it, and a screenshot.
"""

import os
import time

import bpy
from sidebar_steps import (
    STEP_PIXELS,
    copied_under_mouse,
    ended_operators,
    ended_since,
    press_button,
    press_menu_beside,
    shown_buttons,
    watch_popup,
    whole_sidebar,
)
from situations import SITUATIONS, cube, lights_selected, scene
from survival_state import content, difference
from window_steps import (
    FOLDER,
    SECONDS_FOR_REDRAW,
    STORY,
    at,
    click,
    comes_true,
    install,
    look,
    middle_of_view,
    nothing_runs,
    picture_is_ready,
    press,
    redraw,
    render_without_window,
    run,
    slow_click,
    type_text,
    until,
    view,
    write_story,
)

PIE_PIXELS = 120
FIELD_PIXELS = 20
"""By which the mouse goes to the left, into the middle of the field."""
OK_PIXELS = 27
"""From the field down to the button OK."""
PRESETS_ICON = (172, -11)
PRESETS_HEIGHT = 200
SECONDS_TO_UNDO = 10.0
LAST_USED = {
    "multiply_color": {"factor": 3.0},
    "shift_hue": {"turn": 2.0},
    "gradient_color": {"last_color": (0.0, 0.5, 1.0)},
}
"""What the artist gave these when they were used last: with their defaults they would change nothing here."""
NOT_UNDONE = {
    "open_documentation",
    "copy_diagnostics",
    "show_licences",
    "bake_grid",
    "check_bake",
    "clear_bake",
    "show_light_grid",
}
"""What changes nothing of the file."""


LISTED = {"objects selected", "lights selected", "lights edited", "both selected"}
"""Situations in which all buttons of the sidebar are listed."""


def pick_from_the_cube(button):
    yield from until(lambda: not nothing_runs())
    click(at(cube().matrix_world.translation))
    yield SECONDS_FOR_REDRAW


def first_of_the_menu(button):
    yield from look("menu")
    press("DOWN_ARROW", button)
    press("RET", button)
    yield SECONDS_FOR_REDRAW


def popup_is_read(button):
    yield from look("popup")
    press("ESC", button)
    yield SECONDS_FOR_REDRAW


WAITING = {"pick_color": pick_from_the_cube, "paint_detail": first_of_the_menu, "show_licences": popup_is_read}
"""What the artist does while an operator waits for it."""


MENUS = {"paint_detail": ("lock_lights", 20)}
"""Operators that have a menu in place of a button: what it is above, and by how many pixels."""


def press_in(situation, arrange, name):
    """Press one button in a situation, look at the window, and undo and redo it with keys."""
    arrange()
    bpy.ops.ed.undo_push(message=situation)
    for key, value in LAST_USED.get(name, {}).items():
        setattr(bpy.context.window_manager.operator_properties_last(f"vlm.{name}"), key, value)
    before, start = content(), time.monotonic()
    if name in MENUS:
        told = yield from press_menu_beside(*MENUS[name], WAITING[name])
    else:
        told = yield from press_button(name, follow=WAITING.get(name))
    if name == "light_scene" and told["did"]:
        yield from until(picture_is_ready)
    yield from look(f"{situation}_{name}".replace(" ", "_"))
    after = content()
    told["changed"] = bool(difference(before, after))
    if name not in NOT_UNDONE:
        for step, key in (("undone", {}), ("redone", {"shift": True}), ("undone again", {})):
            wanted = after if step == "redone" else before
            press("Z", ctrl=True, **key)
            told[step] = yield from comes_true(lambda wanted=wanted: content() == wanted, SECONDS_TO_UNDO)
            if not told[step]:
                told[f"not {step}"] = difference(content(), wanted)
    bpy.context.window_manager.vlm_overlay.show = False  # the button of the light grid switches it on; it takes time
    told["seconds"] = round(time.monotonic() - start, 1)
    STORY["pressed"][f"{situation}: {name}"] = told
    write_story()


def situation_by_situation():
    for situation, arrange, names in SITUATIONS:
        arrange()
        yield from redraw()
        if situation in LISTED:
            STORY["buttons"][situation] = yield from shown_buttons()
        yield from look(situation.replace(" ", "_"))
        for name in names:
            yield from press_in(situation, arrange, name)


def other_ways():
    """Operators started from the pie menu and from Blender's search."""
    lights_selected()
    bpy.ops.ed.undo_push(message="other ways")
    for name, steps in (("pie", upper_of_the_pie), ("search", found_by_name)):
        before = ended_operators()
        yield from steps()
        yield from comes_true(lambda before=before: ended_since(before), SECONDS_TO_UNDO)
        STORY[name] = ended_since(before)


def upper_of_the_pie():
    press("V", shift=True, alt=True)
    yield from look("pie")
    x, y = middle_of_view()
    yield from slow_click((x, y + PIE_PIXELS))


def found_by_name():
    press("F3")
    yield SECONDS_FOR_REDRAW
    yield from type_text("gradient color")
    yield from look("search")
    press("RET")


def add_preset():
    """Through the icon in the title of Create: the field with the name of the preset, and the plus sign beside it."""
    _, sidebar = view("UI")
    x, top = sidebar.x + PRESETS_ICON[0], sidebar.y + sidebar.height + PRESETS_ICON[1]
    before = ended_operators()
    yield from slow_click((x, top))
    yield from look("presets")
    for y in range(top - STEP_PIXELS, top - PRESETS_HEIGHT, -STEP_PIXELS):
        if (yield from copied_under_mouse((x, y))) == "New Preset":
            break
    for right in range(0, PRESETS_HEIGHT, STEP_PIXELS // 2):
        if "add_preset" in (yield from copied_under_mouse((x + right, y))):
            yield from slow_click((x + right, y))
            break
    yield from comes_true(lambda: ended_since(before), SECONDS_TO_UNDO)
    STORY["preset"] = ended_since(before)
    press("ESC")
    yield from redraw()


def name_in_dialog(button):
    """Where no object is selected, leaving out asks for one, in a field that comes under the mouse: by name."""
    yield from look("dialog")
    field = button[0] - FIELD_PIXELS, button[1]
    yield from slow_click(field)
    yield from type_text("Cube", field)
    yield from look("dialog_filled")
    press("RET", field)
    yield from look("dialog_done")
    yield from slow_click((field[0], field[1] - OK_PIXELS))


def left_out_by_name():
    lights_selected()
    bpy.ops.ed.undo_push(message="lights alone")
    STORY["by name"] = yield from press_button("link_receiver", follow=name_in_dialog)


def notes_what_is_opened():
    """A program of the name that opens documents, which writes down what it was asked to open."""
    program = FOLDER / "xdg-open"
    program.write_text(f'#!/bin/sh\necho "$1" >> "{FOLDER}/opened.txt"\n')
    program.chmod(0o755)
    os.environ["PATH"] = f"{FOLDER}:{os.environ['PATH']}"


def story():
    install()
    yield from whole_sidebar()
    scene()
    notes_what_is_opened()
    watch_popup("show_licences")
    bpy.context.window_manager.vlm_overlay.grid = True  # its panel shows the button with it
    render_without_window()
    STORY.update({"pressed": {}, "buttons": {}, "not undone": sorted(NOT_UNDONE)})
    yield from situation_by_situation()
    yield from other_ways()
    yield from left_out_by_name()
    yield from add_preset()
    STORY["opened"] = (FOLDER / "opened.txt").read_text().split()


run(story())
