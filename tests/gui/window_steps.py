# SPDX-License-Identifier: GPL-3.0-or-later
"""What the stories that are played inside Blender's window share: mouse, keys, screenshots, waiting, the end.

A story is a generator; each of its yields waits that many seconds while Blender runs on. Run by blender_window.py:
`blender … --enable-event-simulate --python-expr "… import drive_…" -- ZIP FOLDER`.
"""

import json
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy
from bpy.app.handlers import persistent
from bpy_extras.view3d_utils import location_3d_to_region_2d

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])
MODULE = "bl_ext.user_default.virtual_light_mesh"
SECONDS_FOR_REDRAW = 0.5
SECONDS_FOR_AN_EVENT = 0.06
SECONDS_BETWEEN_LOOKS = 0.05
SECONDS_UNTIL_SHOWN = 2.0
LONGEST_WAIT_SECONDS = 90.0
DIGITS = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
STORY = {"version": bpy.app.version_string, "seen": []}
"""What the tests read: each story adds its own."""


def window():
    return bpy.context.window_manager.windows[0]


def view(kind="WINDOW"):
    """(area, region of a kind) of the largest 3D view."""
    areas = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda each: each.width * each.height)
    return area, next(region for region in area.regions if region.type == kind)


def in_view(kind="WINDOW"):
    """Context of the 3D view, for operators."""
    area, region = view(kind)
    return bpy.context.temp_override(window=window(), area=area, region=region)


def middle_of_view():
    """A place in the 3D view, beside its sidebar."""
    _, region = view()
    return region.x + region.width // 3, region.y + region.height // 2


def at(world):
    """Where a point in the world shows, in the window."""
    area, region = view()
    x, y = location_3d_to_region_2d(region, area.spaces.active.region_3d, world)
    return int(region.x + x), int(region.y + y)


def in_frame(u, v):
    """The point in the world of a place in the camera's frame, from its upper left."""
    scene = bpy.context.scene
    corners = [scene.camera.matrix_world @ corner for corner in scene.camera.data.view_frame(scene=scene)]
    right, low, left = corners[0], corners[1], corners[3]
    return left + u * (right - left) + v * (low - right)


def framed(u, v):
    """Where a place in the camera's frame shows, in the window."""
    return at(in_frame(u, v))


def event(kind, value, place, **more):
    window().event_simulate(type=kind, value=value, x=int(place[0]), y=int(place[1]), **more)


def move(place):
    event("MOUSEMOVE", "NOTHING", place)


def press(key, place=None, **modifiers):
    """One key with the mouse at a place; over the 3D view where none is given."""
    place = place or middle_of_view()
    move(place)
    event(key, "PRESS", place, **modifiers)
    event(key, "RELEASE", place, **modifiers)


def type_text(text, place=None):
    """Letters, digits, spaces and points, with the mouse at a place; over the 3D view where none is given."""
    place = place or middle_of_view()
    names = dict(zip("0123456789. ", (*DIGITS, "PERIOD", "SPACE"), strict=True))
    for letter in text:
        name = names.get(letter, letter.upper())
        event(name, "PRESS", place, unicode=letter)
        event(name, "RELEASE", place)
        yield SECONDS_FOR_AN_EVENT


def click(place, **modifiers):
    press("LEFTMOUSE", place, **modifiers)


def slow_click(place):
    """A click on a button or a panel: regions hear a press only after they have heard that the mouse is there."""
    move(place)
    yield SECONDS_FOR_REDRAW
    event("LEFTMOUSE", "PRESS", place)
    yield SECONDS_FOR_AN_EVENT
    event("LEFTMOUSE", "RELEASE", place)
    yield SECONDS_FOR_AN_EVENT


def drag(places, before_release=None):
    """A drag through `places`; `before_release`: steps with the button still down."""
    move(places[0])
    event("LEFTMOUSE", "PRESS", places[0])
    for place in places[1:]:
        move(place)
        yield SECONDS_FOR_AN_EVENT
    if before_release is not None:
        yield from before_release
    event("LEFTMOUSE", "RELEASE", places[-1])
    yield SECONDS_FOR_REDRAW


def redraw():
    """Yields until all windows are drawn anew."""
    for each in bpy.context.window_manager.windows:
        for area in each.screen.areas:
            area.tag_redraw()
    yield SECONDS_FOR_REDRAW


def look(name):
    """Yields until all is drawn, and takes a screenshot of all windows into FOLDER."""
    yield from redraw()
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)
    STORY["seen"].append(name)


def until(condition, seconds=LONGEST_WAIT_SECONDS):
    """Yields until `condition` holds; raises after the longest wait."""
    if not (yield from comes_true(condition, seconds)):
        raise TimeoutError(condition.__name__)


def comes_true(condition, seconds):
    """Yields until `condition` holds, or for so long; whether it holds."""
    start = time.monotonic()
    while not condition():
        if time.monotonic() - start > seconds:
            return False
        yield SECONDS_BETWEEN_LOOKS
    return True


def nothing_runs():
    """Whether no operator of ours waits for events."""
    return not any(operator.bl_idname.startswith("VLM_OT") for operator in window().modal_operators)


def light_meshes():
    """The light meshes of the scene that is shown."""
    return [thing for thing in window().scene.objects if "vlm_schema" in thing]


def choose(*things):
    """Select things in object mode; the first one is active."""
    if bpy.context.mode != "OBJECT":
        with in_view():
            bpy.ops.object.mode_set(mode="OBJECT")
    for each in bpy.context.view_layer.objects:
        each.select_set(each in things)
    bpy.context.view_layer.objects.active = things[0] if things else None


def install():
    """Install the extension from its zip; whether it is enabled then."""
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    return MODULE in bpy.context.preferences.addons


def show_sidebar(category="VLM"):
    """Open the sidebar at a tab, ours where none is named."""
    area, _ = view()
    area.spaces.active.show_region_ui = True
    yield from redraw()
    view("UI")[1].active_panel_category = category
    yield from redraw()


def picture_is_shown():
    """Whether a render has ended and Blender shows it in a window of its own."""
    windows = bpy.context.window_manager.windows
    editors = [area for each in windows for area in each.screen.areas if area.type == "IMAGE_EDITOR"]
    return bool(STORY.get("renders") and editors) and not bpy.app.is_job_running("RENDER")


def render_without_window():
    """Let renders open no window of theirs: without a window manager the first one would not hear the mouse after."""
    bpy.context.preferences.view.render_display_type = "NONE"


def picture_is_ready():
    return bool(STORY.get("renders")) and not bpy.app.is_job_running("RENDER")


def close_picture():
    """Close the windows that Blender opened for pictures."""
    STORY["renders"] = 0
    for each in bpy.context.window_manager.windows[1:]:
        with bpy.context.temp_override(window=each):
            bpy.ops.wm.window_close()


@persistent
def _count_render(*_):
    STORY["renders"] = STORY.get("renders", 0) + 1


def write_story():
    (FOLDER / "story.json").write_text(json.dumps(STORY, indent=1))


def run(steps):
    """Go through `steps` once the window is there, write the story and quit."""

    def advance():
        try:
            return next(steps)
        except StopIteration:
            STORY["finished"] = True
        except BaseException:  # noqa: BLE001 (Blender would go on and never quit)
            STORY["error"] = traceback.format_exc()
            subprocess.run(["import", "-window", "root", str(FOLDER / "error.png")], check=False)
        write_story()
        bpy.ops.wm.quit_blender()
        return None

    bpy.context.preferences.view.show_splash = False
    bpy.app.handlers.render_complete.append(_count_render)
    bpy.app.timers.register(advance, first_interval=SECONDS_UNTIL_SHOWN, persistent=True)
