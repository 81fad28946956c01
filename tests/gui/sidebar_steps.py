# SPDX-License-Identifier: GPL-3.0-or-later
"""Presses buttons of the sidebar with the mouse: a button is found by asking Blender what is under the mouse.

The sidebar must fit on the screen: reports and findings move buttons, so each is looked for again before its press.
"""

import re

import bpy
from window_steps import (
    LONGEST_WAIT_SECONDS,
    SECONDS_FOR_AN_EVENT,
    comes_true,
    in_view,
    move,
    nothing_runs,
    press,
    redraw,
    show_sidebar,
    slow_click,
    until,
    view,
)

STEP_PIXELS = 10
LEFT, RIGHT = 0.25, 0.75
"""Shares of the sidebar's width: buttons that share a row are asked for one by one."""
SMALLER = 0.8
"""Scale of the interface, so that the whole sidebar fits on the screen."""
CLOSED_PIXELS = 40
"""Height under which the panel Adjust Last Operation shows its title alone."""
TURNS = 3
TIMES_DRAWN = 5
"""How often a panel is drawn, at most, until its new size shows."""
SECONDS_TO_START = 3.0
CLICKS = 3
COMMAND = re.compile(r"bpy\.ops\.vlm\.(\w+)\((.*)\)")
POPUPS = []
"""Operators that have drawn a popup since the last click: Blender does not list those."""
PLACES = {}
"""Where buttons were seen last."""


def whole_sidebar():
    """Show our tab with all panels open but the effects, which have no operators, beside a view of few lines: software
    draws both at each move of the mouse."""
    panels = [cls for cls in bpy.types.Panel.__subclasses__() if cls.__name__.startswith("VLM_PT_")]
    panels = [cls for cls in panels if getattr(cls, "bl_space_type", "") == "VIEW_3D" and cls.is_registered]
    for cls in reversed(panels):
        bpy.utils.unregister_class(cls)
    for cls in panels:
        if cls.__name__ != "VLM_PT_effects":
            cls.bl_options = set(getattr(cls, "bl_options", ())) - {"DEFAULT_CLOSED"}
        bpy.utils.register_class(cls)
    bpy.context.preferences.system.use_region_overlap = False
    bpy.context.preferences.view.ui_scale = SMALLER
    space = view()[0].spaces.active
    space.shading.type = "WIREFRAME"
    space.overlay.show_floor = False
    yield from show_sidebar()


def command_under_mouse():
    """(operator, its arguments as text) of our button under the mouse, or None."""
    bpy.context.window_manager.clipboard = ""
    with in_view("UI"):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
    found = COMMAND.search(bpy.context.window_manager.clipboard)
    return found and (found[1], found[2])


def rows_of_sidebar():
    """All heights to ask at, from the top."""
    _, sidebar = view("UI")
    return range(sidebar.y + sidebar.height - 4, sidebar.y + 4, -STEP_PIXELS)


def asked(place):
    """Yields until the mouse is there; the command of our button under it, or None.

    The button that the mouse leaves lets go of it in one turn of Blender's, and the next one hears of it in another.
    """
    move(place)
    for _ in range(TURNS):
        yield 0.0
    return command_under_mouse()


def shown_buttons():
    """Yields while the mouse goes over the sidebar; names of the operators that have a button there."""
    _, sidebar = view("UI")
    PLACES.clear()
    for y in rows_of_sidebar():
        for column in (LEFT, RIGHT):
            place = (sidebar.x + int(sidebar.width * column), y)
            command = yield from asked(place)
            if command is None:
                break
            PLACES.setdefault(command[0], place)
    return sorted(PLACES)


def find_button(name, arguments=""):
    """Yields until the mouse is over the button of an operator; its place, or None where there is no such button.

    arguments: what its command must hold. Asks where it was seen last, and from there up and down.
    """
    _, sidebar = view("UI")
    last = PLACES.get(name, (sidebar.x, sidebar.y + sidebar.height))

    def is_wanted(command):
        return command is not None and command[0] == name and arguments in command[1]

    for y in sorted(rows_of_sidebar(), key=lambda each: abs(each - last[1])):
        for column in (LEFT, RIGHT):
            place = (sidebar.x + int(sidebar.width * column), y)
            command = yield from asked(place)
            if is_wanted(command) and is_wanted((yield from asked(place))):
                PLACES[name] = place
                return place
            if command is None:
                break
    return None


def watch_popup(name):
    """Notice when an operator draws its popup."""
    cls = getattr(bpy.types, f"VLM_OT_{name}")
    draw = cls.draw

    def noticed(self, context):
        POPUPS.append(cls.__name__)
        draw(self, context)

    cls.draw = noticed


def ended_operators():
    """(name, place in memory) of the operators that Blender remembers: 32 at most, and it may forget all."""
    return [(each.bl_idname, each.as_pointer()) for each in bpy.context.window_manager.operators]


def ended_since(before):
    """Names of the operators that ended since `ended_operators` said `before`."""
    now = ended_operators()
    known = now.index(before[-1]) + 1 if before and before[-1] in now else 0
    return [name for name, _ in now[known:]]


def press_button(name, arguments="", follow=None):
    """Find a button and click it until something begins, then wait for the end; what came of it.

    follow: steps that the artist takes where it waits. Returns a dict: "found", "clicks", "did" (the operator that
    ended last since, or None), "Esc" (whether that was needed to end it).
    """
    return (yield from press_until_it_begins(lambda: find_button(name, arguments), follow))


def press_menu_beside(name, up, follow):
    """As `press_button`, for a menu of operators, which Blender gives no command for: so far above a button, pixels."""

    def find():
        place = yield from find_button(name)
        move((place[0], place[1] + up))
        yield SECONDS_FOR_AN_EVENT
        return place[0], place[1] + up

    return (yield from press_until_it_begins(find, follow))


def press_until_it_begins(find, follow):
    """Click what `find` finds until something begins, then wait for the end; see `press_button`."""
    told = {"found": False, "clicks": 0, "did": None, "Esc": False}
    before = ended_operators()

    def begun():
        return not nothing_runs() or ended_since(before) or POPUPS

    POPUPS.clear()
    for _ in range(CLICKS):
        yield from redraw()
        place = yield from find()
        if place is None:
            return told
        told["found"] = True
        yield from slow_click(place)
        told["clicks"] += 1
        if follow is not None:
            yield from follow(place)
        if (yield from comes_true(begun, SECONDS_TO_START)):
            break
    if not (yield from comes_true(nothing_runs, LONGEST_WAIT_SECONDS)):
        told["Esc"] = True
        press("ESC")
        yield from until(nothing_runs)
    told["did"] = next(reversed([*POPUPS, *ended_since(before)]), None)
    return told


def adjust_panel():
    """The region of the panel Adjust Last Operation, or None."""
    return next((region for region in view()[0].regions if region.type == "HUD" and region.height > 1), None)


def open_panel(title):
    """Open the panel Adjust Last Operation, by clicks on its title: each may open it or, where Blender was late, close
    it again. Raises where it stays closed.
    """
    for _ in range(CLICKS):
        yield from slow_click(title)
        for _ in range(TIMES_DRAWN):
            yield from redraw()
            if adjust_panel().height >= CLOSED_PIXELS:
                return
    raise TimeoutError("the panel Adjust Last Operation stays closed")


def copied_under_mouse(place):
    """Yields; what Blender copies of the field or button there by Ctrl+C: a value, or the Python command."""
    bpy.context.window_manager.clipboard = ""
    move(place)
    yield SECONDS_FOR_AN_EVENT
    press("C", place, ctrl=True)
    yield SECONDS_FOR_AN_EVENT
    return bpy.context.window_manager.clipboard


def adjust_last(kind, text):
    """Paste a value into a field of the panel Adjust Last Operation: the first one from the top that holds a color,
    where kind is "color", or else a number. Yields; returns whether there was one.
    """
    panel = adjust_panel()
    if panel is None:
        return False
    if panel.height < CLOSED_PIXELS:
        yield from open_panel((panel.x + panel.width // 4, panel.y + panel.height // 2))
        panel = adjust_panel()
    x = panel.x + int(0.7 * panel.width)
    for y in range(panel.y + panel.height - STEP_PIXELS, panel.y, -STEP_PIXELS):
        copied = yield from copied_under_mouse((x, y))
        if copied.startswith("[") if kind == "color" else is_number(copied):
            bpy.context.window_manager.clipboard = text
            press("V", (x, y), ctrl=True)
            yield from redraw()
            return True
    return False


def is_number(text):
    try:
        return bool(text) and float(text.rstrip("°%")) is not None
    except ValueError:
        return False
