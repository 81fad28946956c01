# SPDX-License-Identifier: GPL-3.0-or-later
"""Sits inside Blender's window and disturbs long work: edits, undoes, deletes, saves, loads, disables while it runs.

Run by test_bake_window.py: `blender … --enable-event-simulate --python drive_bake.py -- ZIP FOLDER`. Writes
FOLDER/story.json and screenshots.
"""

import json
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])
MODULE = "bl_ext.user_default.virtual_light_mesh"
GRID = 200
LIGHTS = 100
SECONDS_FOR_REDRAW = 0.7
LONGEST_WAIT_SECONDS = 120.0
STORY = {"seen": []}


def window():
    return bpy.context.window_manager.windows[0]


def in_view():
    """Context of the largest 3D view, for operators."""
    areas = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda each: each.width * each.height)
    region = next(each for each in area.regions if each.type == "WINDOW")
    return bpy.context.temp_override(window=window(), area=area, region=region)


def press(key, **modifiers):
    """One key with the mouse over the 3D view."""
    with in_view():
        area = bpy.context.area
        x, y = area.x + area.width // 3, area.y + area.height // 2
    window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
    window().event_simulate(type=key, value="PRESS", x=x, y=y, **modifiers)
    window().event_simulate(type=key, value="RELEASE", x=x, y=y, **modifiers)


def look(name):
    """Screenshot into FOLDER."""
    for area in window().screen.areas:
        area.tag_redraw()
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)
    STORY["seen"].append(name)


def running():
    return any(operator.bl_idname.startswith("VLM_OT") for operator in window().modal_operators)


def until_it_ends():
    start = time.monotonic()
    while running():
        if time.monotonic() - start > LONGEST_WAIT_SECONDS:
            raise TimeoutError("the work did not end")
        yield 0.1


def lights():
    """Number of lights by name of light mesh, of the scene that is shown."""
    scene = window().scene
    return {thing.name: len(thing.data.polygons) for thing in scene.objects if "vlm_schema" in thing}


def orphans():
    return [mesh.name for mesh in bpy.data.meshes if not mesh.users]


def large_file():
    """A new file with a surface whose simplification takes some seconds."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield SECONDS_FOR_REDRAW
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=GRID, y_subdivisions=GRID, size=2.0)
    bpy.context.object.name = "Large"
    bpy.context.object.display_type = "BOUNDS"
    bpy.ops.ed.undo_push(message="large")


def begin():
    """Start the work on what is selected."""
    with in_view():
        result = bpy.ops.vlm.create_from_selection("INVOKE_DEFAULT", target_triangles=LIGHTS)
    return sorted(result)


def disturbed(name, disturb, end=until_it_ends):
    """One story: a large file, work on it, `disturb` in the middle of it, and what there is afterwards."""
    yield from large_file()
    told = STORY[name] = {"began": begin()}
    yield 0.3
    told["ran"] = running()
    result = disturb()
    yield 0.3
    told["ran after"] = running()
    look(name)
    yield from end()
    yield SECONDS_FOR_REDRAW
    told |= {"lights": lights(), "orphans": orphans(), "objects": len(window().scene.objects), "said": result}
    told["scene"] = window().scene.name
    (FOLDER / "story.json").write_text(json.dumps(STORY, indent=1))


def delete_source():
    bpy.data.meshes.remove(bpy.data.objects["Large"].data)  # the object goes with it


def edit_source():
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0.0, 0.0, 1.0))


def undo():
    press("Z", ctrl=True)


def save():
    with in_view():
        return sorted(bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "saved.blend")))


def load():
    with in_view():
        return sorted(bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "other.blend")))


def delete_scene():
    large = window().scene
    window().scene = bpy.data.scenes.new("Another")
    bpy.data.scenes.remove(large)


def begin_again():
    try:
        return begin()
    except RuntimeError as error:
        return str(error)


def disable():
    bpy.ops.preferences.addon_disable(module=MODULE)


def escape():
    press("ESC")


def in_german():
    """The sidebar in German, to be looked at, and what Blender says for some texts."""
    view = bpy.context.preferences.view
    view.language, view.use_translate_interface = "de_DE", True
    yield SECONDS_FOR_REDRAW
    with in_view():
        area = bpy.context.area
        area.spaces.active.show_region_ui = True
    yield SECONDS_FOR_REDRAW
    next(region for region in area.regions if region.type == "UI").active_panel_category = "VLM"
    yield SECONDS_FOR_REDRAW
    look("german")
    tell = bpy.app.translations.pgettext_iface
    STORY["german"] = [tell("Bake Light Grid", "Operator"), tell("Target Triangles")]
    view.language = "en_US"


def story():
    """The steps; each yield waits that many seconds while Blender runs on."""
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    yield SECONDS_FOR_REDRAW
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "other.blend"), copy=True)
    for name, disturb in (
        ("delete source", delete_source),
        ("edit source", edit_source),
        ("undo", undo),
        ("save", save),
        ("begin again", begin_again),
        ("delete scene", delete_scene),
        ("escape", escape),
        ("load", load),
    ):
        yield from disturbed(name.replace(" ", "_"), disturb)
    yield from disturbed("disable", disable, end=lambda: iter(()))
    yield 5.0
    STORY["alive after disable"] = True
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield from in_german()
    yield from large_file()
    STORY["after all"] = {"began": begin()}
    yield from until_it_ends()
    STORY["after all"]["lights"] = lights()
    STORY["finished"] = True


def run(steps):
    """A timer callback that goes through `steps`, writes the story and quits."""

    def advance():
        try:
            return next(steps)
        except StopIteration:
            pass
        except BaseException:  # noqa: BLE001 (Blender would go on and never quit)
            STORY["error"] = traceback.format_exc()
        (FOLDER / "story.json").write_text(json.dumps(STORY, indent=1))
        bpy.ops.wm.quit_blender()
        return None

    return advance


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(run(story()), first_interval=2.0, persistent=True)
