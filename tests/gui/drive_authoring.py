# SPDX-License-Identifier: GPL-3.0-or-later
"""Sits inside Blender's window and presses every button of the sidebar with the mouse, in each situation.

Run by test_authoring.py: `blender … --enable-event-simulate --python drive_authoring.py -- ZIP FOLDER`. A button is
found by moving the mouse over the sidebar and asking Blender for the Python command of what is under it. Writes
FOLDER/story.json: for each situation and button what came of it, and a screenshot after each.
"""

import hashlib
import json
import re
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bmesh
import bpy
import numpy as np

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])
SECONDS_FOR_REDRAW = 0.4
SECONDS_FOR_A_MOVE = 0.05
LONGEST_WAIT_SECONDS = 60.0
STEP_PIXELS = 18
LEFT, RIGHT = 0.3, 0.8
"""Shares of the sidebar's width: buttons that share a row are asked for one by one."""
PAGES = 4
CLICKS = 2
"""The first click on a sidebar that has just been scrolled may go to its scrolling."""
SCROLLS_PER_PAGE = 12
PLACE = {"page": 0}
"""How far the sidebar is scrolled."""
COMMAND = re.compile(r"bpy\.ops\.vlm\.(\w+)\((.*)\)")
BUDGET = 60
LEFT_OUT = {"light_scene", "open_documentation", "paint_detail", "show_licences"}
"""Buttons that render a picture (test_window.py presses them), open a browser, a menu or a list that stays open."""
STORY = {"version": bpy.app.version_string, "pressed": {}, "buttons": {}, "left out": sorted(LEFT_OUT)}


def window():
    return bpy.context.window_manager.windows[0]


def region(kind):
    """(area, region) of the largest 3D view."""
    areas = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda each: each.width * each.height)
    return area, next(each for each in area.regions if each.type == kind)


def over(kind):
    area, found = region(kind)
    return bpy.context.temp_override(window=window(), area=area, region=found)


def event(kind, value, place, **more):
    window().event_simulate(type=kind, value=value, x=place[0], y=place[1], **more)


def click(place):
    event("MOUSEMOVE", "NOTHING", place)
    yield SECONDS_FOR_A_MOVE
    event("LEFTMOUSE", "PRESS", place)
    event("LEFTMOUSE", "RELEASE", place)
    yield SECONDS_FOR_A_MOVE


def middle_of_view(right=0.0, up=0.0):
    _, found = region("WINDOW")
    return (
        found.x + int(found.width * (0.4 + right)),
        found.y + int(found.height * (0.5 + up)),
    )


def press(key, **modifiers):
    place = middle_of_view()
    event("MOUSEMOVE", "NOTHING", place)
    event(key, "PRESS", place, **modifiers)
    event(key, "RELEASE", place, **modifiers)


def redraw():
    for area in window().screen.areas:
        area.tag_redraw()


def look(name):
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)


def until(condition):
    """Yields until `condition` holds; raises after the longest wait."""
    start = time.monotonic()
    while not condition():
        if time.monotonic() - start > LONGEST_WAIT_SECONDS:
            raise TimeoutError(condition.__name__)
        yield 0.1


def nothing_runs():
    return not any(operator.bl_idname.startswith("VLM_OT") for operator in window().modal_operators)


def light_meshes():
    return [thing for thing in bpy.context.scene.objects if "vlm_schema" in thing]


def content():
    """Digest of all objects and of the face attributes and corners of all meshes."""
    parts = []
    for thing in sorted(bpy.data.objects, key=lambda each: each.name):
        values = {key: str(thing[key]) for key in thing.keys() if key.startswith("vlm_")}  # noqa: SIM118
        parts.append(repr((thing.name, sorted(values), thing.parent and thing.parent.name, len(thing.modifiers))))
        if thing.type == "MESH":
            parts.append(faces(thing))
    return hashlib.sha1("\n".join(parts).encode()).hexdigest()


def faces(thing):
    copy = thing.data
    if thing.mode == "EDIT":
        copy = bpy.data.meshes.new("copy")
        edited = bmesh.from_edit_mesh(thing.data).copy()
        edited.to_mesh(copy)
        edited.free()
    found = [[tuple(vertex.co) for vertex in copy.vertices]]
    for attribute in copy.attributes:
        if attribute.name.startswith("vlm_"):
            color = attribute.data_type == "FLOAT_COLOR"
            values = np.empty(len(attribute.data) * (4 if color else 1), np.float32 if color else np.float64)
            attribute.data.foreach_get("color" if color else "value", values)
            found.append((attribute.name, values.tobytes()))
    if copy is not thing.data:
        bpy.data.meshes.remove(copy)
    return hashlib.sha1(repr(found).encode()).hexdigest()


def scroll(kind, count):
    """Turn the wheel over the sidebar."""
    _, sidebar = region("UI")
    for _ in range(count):
        event(kind, "PRESS", (sidebar.x + sidebar.width // 2, sidebar.y + sidebar.height // 2))
        yield SECONDS_FOR_A_MOVE
    if count:
        yield SECONDS_FOR_REDRAW


def to_page(page):
    """Scroll the sidebar to a page; to its top in any case where that is asked for."""
    if page < PLACE["page"] or page == 0:
        yield from scroll("WHEELUPMOUSE", PLACE["page"] * SCROLLS_PER_PAGE)
        PLACE["page"] = 0
    yield from scroll("WHEELDOWNMOUSE", (page - PLACE["page"]) * SCROLLS_PER_PAGE)
    PLACE["page"] = page


def top_of_sidebar():
    with over("UI"):
        return round(bpy.context.region.view2d.region_to_view(0.0, 0.0)[1])


def find_buttons():
    """{operator: (page, place on the screen)} of each operator's first button in the sidebar."""
    found, seen = {}, set()
    yield from to_page(0)
    for page in range(PAGES):
        if top_of_sidebar() in seen:
            break
        seen.add(top_of_sidebar())
        yield from scan(page, found)
        yield from to_page(page + 1)
    return found


def scan(page, found):
    """Ask what is under the mouse, row by row of the sidebar."""
    _, sidebar = region("UI")
    for y in range(sidebar.y + sidebar.height - 12, sidebar.y + 8, -STEP_PIXELS):
        for column in (LEFT, RIGHT):
            place = (sidebar.x + int(sidebar.width * column), y)
            event("MOUSEMOVE", "NOTHING", place)
            yield 0.0
            command = COMMAND.search(command_under_mouse())
            if command and command[1] not in found:
                found[command[1]] = (page, place)
            if not command:
                break


def command_under_mouse():
    bpy.context.window_manager.clipboard = ""
    with over("UI"):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
    return bpy.context.window_manager.clipboard


def press_button(name, page, place, situation):
    """Click one button, follow it through where it waits for a click on a surface, and take it back by Ctrl+Z."""
    start = time.monotonic()
    yield from to_page(page)
    before, operators = content(), len(bpy.context.window_manager.operators)
    for _ in range(CLICKS):
        yield from click(place)
        yield SECONDS_FOR_REDRAW
        if not nothing_runs() or content() != before or len(bpy.context.window_manager.operators) > operators:
            break
    waited = not nothing_runs()
    for _ in range(20):
        if nothing_runs():
            break
        yield SECONDS_FOR_REDRAW
    if not nothing_runs():
        yield from click(middle_of_view())
        yield SECONDS_FOR_REDRAW
    ended_by_esc = not nothing_runs()
    if ended_by_esc:
        press("ESC")
        yield SECONDS_FOR_REDRAW
    yield from until(nothing_runs)
    yield SECONDS_FOR_REDRAW
    look(f"{situation}_{name}".replace(" ", "_"))
    done = [each.bl_idname for each in bpy.context.window_manager.operators][operators:]
    told = {"done": done, "modal": waited, "Esc": ended_by_esc, "changed": content() != before}
    if told["changed"]:
        press("Z", ctrl=True)
        yield SECONDS_FOR_REDRAW
        told["undone"] = content() == before
    told["seconds"] = time.monotonic() - start
    STORY["pressed"].setdefault(name, {})[situation] = told
    write_story()


def press_all(situation, arrange):
    """Find the buttons that this situation shows, and press each of them once over the whole story."""
    arrange()
    bpy.ops.ed.undo_push(message=situation)
    redraw()
    yield SECONDS_FOR_REDRAW
    start = time.monotonic()
    found = yield from find_buttons()
    STORY.setdefault("seconds to find", {})[situation] = time.monotonic() - start
    STORY["buttons"][situation] = sorted(found)
    yield from to_page(0)
    look(situation.replace(" ", "_"))
    for name, (page, place) in found.items():
        if name in LEFT_OUT or any(
            f"VLM_OT_{name}" in told["done"] for told in STORY["pressed"].get(name, {}).values()
        ):
            continue
        with over("UI"):
            enabled = getattr(bpy.ops.vlm, name).poll()
        if not enabled:
            continue
        yield from press_button(name, page, place, situation)
        arrange()
        yield SECONDS_FOR_REDRAW


def open_panels():
    """Register the panels of the sidebar anew so that none of them begins closed."""
    panels = [cls for cls in bpy.types.Panel.__subclasses__() if cls.__name__.startswith("VLM_PT_")]
    panels = [cls for cls in panels if getattr(cls, "bl_space_type", "") == "VIEW_3D" and cls.is_registered]
    for cls in reversed(panels):
        bpy.utils.unregister_class(cls)
    for cls in panels:
        cls.bl_options = set(getattr(cls, "bl_options", ())) - {"DEFAULT_CLOSED"}
        bpy.utils.register_class(cls)


def choose(*things):
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for each in bpy.context.view_layer.objects:
        each.select_set(each in things)
    bpy.context.view_layer.objects.active = things[0]


def cube():
    choose(bpy.data.objects["Cube"])


def lights_selected():
    choose(light_meshes()[0])


def lights_edited():
    choose(light_meshes()[0])
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")


def both():
    choose(light_meshes()[0], bpy.data.objects["Cube"])


def story():
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    open_panels()
    area, _ = region("WINDOW")
    area.spaces.active.show_region_ui = True
    # A sidebar of its own beside a view of few lines: software renderers draw both at each move of the mouse.
    bpy.context.preferences.system.use_region_overlap = False
    area.spaces.active.shading.type = "WIREFRAME"
    area.spaces.active.overlay.show_floor = False
    yield SECONDS_FOR_REDRAW
    region("UI")[1].active_panel_category = "VLM"
    bpy.context.scene.vlm.target_triangles = BUDGET
    bpy.data.objects["Cube"].keyframe_insert("location", frame=1)
    bpy.data.objects["Cube"].keyframe_insert("location", frame=2)
    yield from press_all("object selected", cube)
    cube()
    with over("WINDOW"):
        bpy.ops.vlm.create_from_selection("EXEC_DEFAULT", True, target_triangles=BUDGET)
    light_meshes()[0].data.attributes["vlm_color"].data[0].color = (3.0, 3.0, 3.0, 1.0)
    with over("WINDOW"):
        bpy.ops.vlm.check("EXEC_DEFAULT", True)
    for situation, arrange in (
        ("light mesh selected", lights_selected),
        ("light mesh edited", lights_edited),
        ("both selected", both),
    ):
        yield from press_all(situation, arrange)
    STORY["finished"] = True


def write_story():
    (FOLDER / "story.json").write_text(json.dumps(STORY, indent=1))


def run(steps):
    """A timer callback that goes through `steps`, writes the story and quits."""

    def advance():
        try:
            return next(steps)
        except StopIteration:
            pass
        except BaseException:  # noqa: BLE001 (Blender would go on and never quit)
            STORY["error"] = traceback.format_exc()
        write_story()
        bpy.ops.wm.quit_blender()
        return None

    return advance


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(run(story()), first_interval=2.0)
