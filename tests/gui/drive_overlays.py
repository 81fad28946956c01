# SPDX-License-Identifier: GPL-3.0-or-later
"""Sits inside Blender's window and switches the overlays of a light mesh on, one after the other.

Run by test_overlay_window.py: `blender … --python drive_overlays.py -- ZIP FOLDER`. Writes FOLDER/story.json and a
screenshot of each overlay.
"""

import json
import subprocess
import sys
import traceback
from pathlib import Path

import bpy

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])
SECONDS_FOR_REDRAW = 0.7
LIGHTS = 60
STORY = {"seen": []}


def view():
    """The largest 3D view and its main region."""
    areas = [area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda each: each.width * each.height)
    return area, next(region for region in area.regions if region.type == "WINDOW")


def in_view():
    """Context of the 3D view, for operators."""
    area, region = view()
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area, region=region)


def look(name):
    """Redraws the view; yields until that is done and takes a screenshot."""
    view()[0].tag_redraw()
    yield SECONDS_FOR_REDRAW
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)
    STORY["seen"].append(name)


def red_ball():
    """The default cube as a red ball; its light mesh."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0)
    material = bpy.data.materials.new("red")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.02, 0.02, 1.0)
    bpy.context.object.data.materials.append(material)
    bpy.context.object["vlm_tag"] = 3
    with in_view():
        STORY["created"] = sorted(bpy.ops.vlm.create_from_scene(target_triangles=LIGHTS))
    return next(thing for thing in bpy.context.scene.objects if "vlm_schema" in thing)


def story():
    """The steps; each yield waits that many seconds while Blender runs on."""
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    yield SECONDS_FOR_REDRAW
    lights = red_ball()
    handlers = bpy.app.handlers.depsgraph_update_post
    STORY["handlers"] = [len(handlers)]
    view()[0].spaces.active.overlay.show_cursor = False
    yield from look("off")
    shown = bpy.context.window_manager.vlm_overlay
    shown.show, shown.sides, shown.findings, shown.opacity = True, False, False, 1.0
    STORY["handlers"].append(len(handlers))
    yield from look("color")
    shown.fill = "TAGS"
    yield from look("tags")
    shown.fill = "COLOR"
    bpy.context.view_layer.objects.active = lights
    for mode in ("EDIT", "OBJECT"):
        with in_view():
            bpy.ops.object.mode_set(mode=mode)
            if mode == "EDIT":
                bpy.ops.mesh.select_all(action="SELECT")
                bpy.ops.mesh.flip_normals()
                bpy.ops.mesh.select_all(action="DESELECT")
        shown.sides = mode == "EDIT"
        yield from look(f"turned_{mode.lower()}")
    shown.fill, shown.sides, shown.grid_place = "NONE", False, "Y"
    with in_view():
        STORY["grid"] = sorted(bpy.ops.vlm.show_light_grid())
    yield from look("grid")
    shown.show = False
    STORY["handlers"].append(len(handlers))
    yield from look("off_again")
    STORY["finished"] = True


STEPS = story()


def step():
    """One step of the story for each call of the timer."""
    try:
        return next(STEPS)
    except StopIteration:
        pass
    except BaseException:  # noqa: BLE001 (Blender would go on and never quit)
        STORY["error"] = traceback.format_exc()
    (FOLDER / "story.json").write_text(json.dumps(STORY))
    bpy.ops.wm.quit_blender()
    return None


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(step, first_interval=1.0, persistent=True)
