# SPDX-License-Identifier: GPL-3.0-or-later
"""Sits inside Blender's window and does what a new user does, with the mouse and keys where it can.

Run by test_window.py: `blender … --enable-event-simulate --python drive.py -- ZIP FOLDER`. Writes FOLDER/story.json and
a screenshot after each step.
"""

import json
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])
SECONDS_FOR_REDRAW = 0.7
LONGEST_WAIT_SECONDS = 120.0
GRID = 700
FRAMES_UNTIL_SHOWN = 4
PICTURES = []
STORY = {"version": bpy.app.version_string, "seen": []}


def window():
    return bpy.context.window_manager.windows[0]


def view():
    """The largest 3D view and its main region."""
    areas = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda each: each.width * each.height)
    return area, next(region for region in area.regions if region.type == "WINDOW")


def in_view():
    """Context of the 3D view, for operators."""
    area, region = view()
    return bpy.context.temp_override(window=window(), area=area, region=region)


def press(key, **modifiers):
    """One key with the mouse over the 3D view."""
    area, _ = view()
    x, y = area.x + area.width // 3, area.y + area.height // 2
    window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
    window().event_simulate(type=key, value="PRESS", x=x, y=y, **modifiers)
    window().event_simulate(type=key, value="RELEASE", x=x, y=y, **modifiers)


def redraw():
    for each in bpy.context.window_manager.windows:
        for area in each.screen.areas:
            area.tag_redraw()


def look(name):
    """Screenshot of all windows into FOLDER."""
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)
    STORY["seen"].append(name)


def effects_tab():
    """A tab that holds the panel Effects alone, opened: Blender remembers that the panel itself begins closed."""
    panel = bpy.types.VLM_PT_effects
    members = {"bl_label": panel.bl_label, "draw": panel.draw, "bl_category": "VLM Effects", "bl_options": set()}
    bpy.utils.register_class(type("VLM_PT_effects_alone", panel.__bases__, members))
    return members["bl_category"]


def until(condition):
    """Yields until `condition` holds; raises after the longest wait."""
    start = time.monotonic()
    while not condition():
        if time.monotonic() - start > LONGEST_WAIT_SECONDS:
            raise TimeoutError(condition.__name__)
        yield 0.1


def light_meshes():
    return [thing.name for thing in bpy.context.scene.objects if "vlm_schema" in thing]


def there_is_a_light_mesh():
    return bool(light_meshes())


def there_is_none():
    return not light_meshes()


def picture_is_shown():
    editors = [
        area for each in bpy.context.window_manager.windows for area in each.screen.areas if area.type == "IMAGE_EDITOR"
    ]
    return bool(PICTURES and editors) and not bpy.app.is_job_running("RENDER")


def keep_count(scene, *_):
    PICTURES.append(scene.name)


def nothing_runs():
    return not any(operator.bl_idname.startswith("VLM_OT") for operator in window().modal_operators)


def close_picture():
    """Close the windows that Blender opened for pictures."""
    PICTURES.clear()
    for each in bpy.context.window_manager.windows[1:]:
        with bpy.context.temp_override(window=each):
            bpy.ops.wm.window_close()


def eevee_picture(name):
    """A small EEVEE render into FOLDER; our engine is chosen again afterwards."""
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_EEVEE"
    scene.eevee.taa_render_samples = 1
    scene.render.resolution_percentage = 10
    scene.render.filepath = str(FOLDER / f"{name}.png")
    bpy.ops.render.render(write_still=True)
    scene.render.engine = "VLM_ENGINE"


def room():
    """The default cube in a room with a red and a green side, seen from inside."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 2.0))
    walls = bpy.context.object
    walls.name = "Room"
    walls.scale = (20.0, 20.0, 6.0)
    walls.data.flip_normals()
    for name, color in (("grey", (0.7, 0.7, 0.7, 1)), ("red", (0.8, 0.05, 0.05, 1)), ("green", (0.1, 0.6, 0.1, 1))):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
        walls.data.materials.append(material)
    for polygon in walls.data.polygons:
        polygon.material_index = 1 if polygon.normal.x > 0.9 else 2 if polygon.normal.y > 0.9 else 0
    walls.display_type = "WIRE"
    bpy.data.objects["Light"].location = (1.0, -2.0, 4.5)
    scene = bpy.context.scene
    scene.vlm.samples = 2


def story():
    """The steps; each yield waits that many seconds while Blender runs on."""
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    STORY["enabled"] = "bl_ext.user_default.virtual_light_mesh" in bpy.context.preferences.addons
    area, _ = view()
    area.spaces.active.show_region_ui = True
    yield SECONDS_FOR_REDRAW
    sidebar = next(region for region in area.regions if region.type == "UI")
    sidebar.active_panel_category = "VLM"
    redraw()
    yield SECONDS_FOR_REDRAW
    look("1_default_file")

    bpy.context.scene.render.resolution_percentage = 25  # a software renderer would need minutes for all pixels
    with in_view():
        STORY["first button"] = sorted(bpy.ops.vlm.light_scene("INVOKE_DEFAULT"))
    yield from until(there_is_a_light_mesh)
    yield from until(picture_is_shown)
    redraw()
    yield SECONDS_FOR_REDRAW
    look("2_first_button")
    bpy.data.images["Render Result"].save_render(str(FOLDER / "first_picture.png"))
    close_picture()
    for name in light_meshes():
        bpy.data.objects.remove(bpy.data.objects[name])

    room()
    bpy.ops.ed.undo_push(message="room")
    bpy.ops.object.select_all(action="SELECT")
    with in_view():
        STORY["create"] = sorted(bpy.ops.vlm.create_from_selection("INVOKE_DEFAULT", target_triangles=200))
    yield from until(there_is_a_light_mesh)
    redraw()
    yield SECONDS_FOR_REDRAW
    look("3_created")
    STORY["lights"] = {name: len(bpy.data.objects[name].data.polygons) for name in light_meshes()}

    press("Z", ctrl=True)
    yield from until(there_is_none)
    yield SECONDS_FOR_REDRAW
    look("4_undone")
    press("Z", ctrl=True, shift=True)
    yield from until(there_is_a_light_mesh)
    yield SECONDS_FOR_REDRAW
    look("5_redone")

    with in_view():
        STORY["check"] = sorted(bpy.ops.vlm.check("INVOKE_DEFAULT"))
    yield from until(nothing_runs)
    with in_view():
        STORY["light scene"] = sorted(bpy.ops.vlm.light_scene("INVOKE_DEFAULT"))
    yield from until(picture_is_shown)
    redraw()
    yield SECONDS_FOR_REDRAW
    look("6_lit")
    STORY["engine"] = bpy.context.scene.render.engine
    bpy.data.images["Render Result"].save_render(str(FOLDER / "render_result.png"))

    close_picture()
    area, _ = view()
    area.spaces.active.shading.type = "RENDERED"
    redraw()
    yield SECONDS_FOR_REDRAW
    look("7_rendered_view")
    area.spaces.active.shading.type = "SOLID"

    effects = effects_tab()
    redraw()
    yield SECONDS_FOR_REDRAW
    next(region for region in area.regions if region.type == "UI").active_panel_category = effects
    redraw()
    yield SECONDS_FOR_REDRAW
    look("7_effects")
    bpy.utils.unregister_class(bpy.types.VLM_PT_effects_alone)

    eevee_picture("eevee_with")
    for name in light_meshes():
        bpy.data.objects.remove(bpy.data.objects[name])
    eevee_picture("eevee_without")
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=GRID, y_subdivisions=GRID, size=2.0)
    bpy.context.object.display_type = "BOUNDS"
    with in_view():
        STORY["long work"] = sorted(bpy.ops.vlm.create_from_selection("INVOKE_DEFAULT", target_triangles=100))
    for _ in range(FRAMES_UNTIL_SHOWN):
        yield SECONDS_FOR_REDRAW
    STORY["ran at Esc"] = not nothing_runs()
    look("8_progress")
    press("ESC")
    yield from until(nothing_runs)
    STORY["after Esc"] = light_meshes()

    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.virtual_light_mesh")
    redraw()
    yield SECONDS_FOR_REDRAW
    look("9_disabled")
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
bpy.app.handlers.render_complete.append(keep_count)
bpy.app.timers.register(run(story()), first_interval=2.0)
