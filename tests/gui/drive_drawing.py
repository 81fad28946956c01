# SPDX-License-Identifier: GPL-3.0-or-later
"""Sits inside Blender's window and draws lights into the Cornell box with mouse and keys, with each drawing tool.

Run by test_drawing_window.py: `blender … --enable-event-simulate --python drive_drawing.py -- ZIP FOLDER`; FOLDER holds
cornell_box.blend. Writes FOLDER/story.json: what each stroke made and how long our own callbacks took, and screenshots.
"""

import json
import math
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])
PACKAGE = "bl_ext.user_default.virtual_light_mesh"
SECONDS_FOR_REDRAW = 0.4
SECONDS_FOR_AN_EVENT = 0.06
STEPS = 10
SEGMENTS, RINGS = 512, 257
"""A ball of these has 262,144 triangles."""
TEXELS = 2048
STORY = {"version": bpy.app.version_string, "made": {}, "milliseconds": {}}

POLYGONS = {
    "back wall": [(0.3, 0.28), (0.46, 0.28), (0.46, 0.37), (0.3, 0.37)],
    "red wall": [(0.05, 0.12), (0.2, 0.28), (0.2, 0.7), (0.05, 0.8)],
    "green wall": [(0.81, 0.3), (0.945, 0.2), (0.945, 0.8), (0.81, 0.66)],
    "floor": [(0.33, 0.9), (0.5, 0.9), (0.43, 0.955)],
    "ceiling": [(0.25, 0.17), (0.36, 0.18), (0.33, 0.05), (0.16, 0.05)],
    "block front": [(0.33, 0.465), (0.5, 0.465), (0.5, 0.8), (0.33, 0.81)],
    "block side": [(0.284, 0.465), (0.3, 0.465), (0.3, 0.8), (0.284, 0.78)],
    "ball, left": [(0.58, 0.715), (0.645, 0.69), (0.66, 0.765), (0.59, 0.8)],
    "ball, right": [(0.663, 0.7), (0.72, 0.75), (0.71, 0.83), (0.663, 0.815)],
}
"""Corners in the camera's frame, from its upper left."""


def window():
    return bpy.context.window_manager.windows[0]


def view():
    """The largest 3D view and its main region."""
    areas = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda each: each.width * each.height)
    return area, next(region for region in area.regions if region.type == "WINDOW")


def in_view():
    area, region = view()
    return bpy.context.temp_override(window=window(), area=area, region=region)


def at(world):
    """Where a point in the world shows, in the window."""
    area, region = view()
    x, y = location_3d_to_region_2d(region, area.spaces.active.region_3d, world)
    return int(region.x + x), int(region.y + y)


def framed(u, v):
    """Where a place in the camera's frame shows."""
    scene = bpy.context.scene
    corners = [scene.camera.matrix_world @ corner for corner in scene.camera.data.view_frame(scene=scene)]
    right, low, left = corners[0], corners[1], corners[3]
    return at(left + u * (right - left) + v * (low - right))


def event(kind, value, place, **more):
    window().event_simulate(type=kind, value=value, x=place[0], y=place[1], **more)


def press(key, place, **modifiers):
    event(key, "PRESS", place, **modifiers)
    event(key, "RELEASE", place, **modifiers)


def click(place):
    event("MOUSEMOVE", "NOTHING", place)
    event("LEFTMOUSE", "PRESS", place)
    event("LEFTMOUSE", "RELEASE", place)


def drag(places, name=None):
    """A drag through `places`, with a screenshot before the button is let go."""
    event("MOUSEMOVE", "NOTHING", places[0])
    event("LEFTMOUSE", "PRESS", places[0])
    for place in places[1:]:
        event("MOUSEMOVE", "NOTHING", place)
        yield SECONDS_FOR_AN_EVENT
    if name:
        yield SECONDS_FOR_REDRAW
        look(name)
    event("LEFTMOUSE", "RELEASE", places[-1])
    yield SECONDS_FOR_REDRAW


def line(first, last):
    shares = np.linspace(0.0, 1.0, STEPS)
    return [tuple(int(a + share * (b - a)) for a, b in zip(first, last, strict=True)) for share in shares]


def polygon(corners, end="click"):
    for corner in corners:
        click(corner)
        yield SECONDS_FOR_AN_EVENT
    click(corners[0]) if end == "click" else press(end, corners[-1])
    yield SECONDS_FOR_REDRAW


def look(name):
    for area in window().screen.areas:
        area.tag_redraw()
    subprocess.run(["import", "-window", "root", str(FOLDER / f"drawing_{name}.png")], check=True)


def light_meshes():
    return [thing for thing in bpy.context.scene.objects if "vlm_schema" in thing]


def lights():
    for thing in light_meshes():
        thing.update_from_editmode()
    return sum(len(thing.data.polygons) for thing in light_meshes())


def tool(name):
    with in_view():
        bpy.ops.wm.tool_set_by_id(name=f"vlm.{name}")


def made(name, before):
    """Keep how many lights a stroke made, with the mean colour and facing of the last."""
    told = {"lights": lights() - before}
    if told["lights"] > 0:
        mesh = light_meshes()[0].data
        told["color"] = [round(value, 3) for value in mesh.attributes["vlm_color"].data[-1].color[:3]]
        told["normal"] = [round(value, 3) for value in mesh.polygons[-1].normal]
    STORY["made"][name] = told


def trace():
    """Time the callbacks of strokes, by event: wall clock, and processor time of the thread."""
    stroke = sys.modules[f"{PACKAGE}.vlm_addon.blender.drawing.draw_modal"].ModalStroke
    handled = stroke._handled

    def timed(self, context, event):
        wall, busy = time.perf_counter(), time.thread_time()
        try:
            return handled(self, context, event)
        finally:
            spent = (1000.0 * (time.perf_counter() - wall), 1000.0 * (time.thread_time() - busy))
            name = f"{STORY.get('part', '')}: {type(self).__name__} {event.type} {event.value}"
            STORY["milliseconds"].setdefault(name, []).append([round(value, 2) for value in spent])

    stroke._handled = timed


def open_box():
    """The Cornell box without its lights, through its camera."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "cornell_box.blend"))
    yield SECONDS_FOR_REDRAW
    for thing in light_meshes():
        bpy.data.objects.remove(thing)
    for thing in bpy.context.selected_objects:
        thing.select_set(False)
    bpy.context.view_layer.objects.active = None
    space = view()[0].spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.shading.color_type = "MATERIAL"
    bpy.ops.ed.undo_push(message="empty box")
    yield SECONDS_FOR_REDRAW


def polygons():
    tool("polygon_object")
    yield SECONDS_FOR_REDRAW
    space = view()[0].spaces.active
    corners = [framed(*place) for place in POLYGONS["back wall"]]
    for corner in corners:
        click(corner)
        yield SECONDS_FOR_AN_EVENT
    event("MOUSEMOVE", "NOTHING", framed(0.32, 0.33))
    yield SECONDS_FOR_REDRAW
    look("1_polygon")
    STORY["before the end"] = lights()
    zoom = space.region_3d.view_camera_zoom
    press("WHEELUPMOUSE", corners[0])
    yield SECONDS_FOR_REDRAW
    STORY["zoomed amid a stroke"] = space.region_3d.view_camera_zoom != zoom
    press("WHEELDOWNMOUSE", corners[0])
    yield SECONDS_FOR_REDRAW
    press("BACK_SPACE", corners[0])
    yield SECONDS_FOR_AN_EVENT
    press("ESC", corners[0])
    yield SECONDS_FOR_REDRAW
    STORY["after Esc"] = [lights(), len(light_meshes()), len(window().modal_operators)]
    for number, (name, places) in enumerate(POLYGONS.items()):
        before = lights()
        yield from polygon([framed(*place) for place in places], "RET" if number % 2 else "click")
        made(name, before)
    before = lights()
    circle = [framed(0.63 + 0.04 * math.cos(a), 0.84 + 0.03 * math.sin(a)) for a in np.linspace(0.0, 6.0, 16)]
    yield from drag(circle)
    made("freehand on the ball", before)
    look("2_ten_polygons")
    before = lights()
    press("Z", corners[0], ctrl=True)
    yield SECONDS_FOR_REDRAW
    undone = lights()
    press("Z", corners[0], ctrl=True, shift=True)
    yield SECONDS_FOR_REDRAW
    STORY["undo and redo"] = [before - undone, lights() - before]


def shapes():
    tool("rectangle_object")
    yield SECONDS_FOR_REDRAW
    properties = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties("vlm.draw_rectangle")
    properties.columns, properties.rows = 3, 2
    before = lights()
    yield from drag(line(framed(0.565, 0.265), framed(0.745, 0.565)), "3_rectangle")
    made("rectangle", before)
    tool("extrude_object")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from drag(line(framed(0.745, 0.335), framed(0.9, 0.36)), "4_extrude")
    made("round the corner", before)
    tool("cut_object")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from drag(line(framed(0.38, 0.26), framed(0.4, 0.39)))
    made("cut", before)
    tool("erase_object")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from drag(line(framed(0.58, 0.3), framed(0.73, 0.31)), "5_erase")
    made("erase", before)
    look("6_erased")


def other_views():
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
    tool("polygon_edit_mesh")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from polygon([framed(*place) for place in ((0.56, 0.9), (0.66, 0.905), (0.65, 0.945), (0.55, 0.945))])
    look("7_edit_mode")
    with in_view():
        bpy.ops.object.mode_set(mode="OBJECT")
        made("in edit mode", before)
        bpy.ops.view3d.view_axis(type="FRONT")
    view()[0].spaces.active.region_3d.view_perspective = "ORTHO"
    yield 2 * SECONDS_FOR_REDRAW
    tool("polygon_object")
    middle = at((1.5, 5.0, 4.0))
    before = lights()
    yield from polygon([(middle[0] - 20, middle[1]), (middle[0] + 20, middle[1]), (middle[0], middle[1] + 20)])
    made("orthographic", before)
    look("8_orthographic")


def heavy():
    """A textured ball of 262,144 triangles, so that a trace shows what our callbacks take there."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    yield SECONDS_FOR_REDRAW
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0, segments=SEGMENTS, ring_count=RINGS)
    ball = bpy.context.object
    material = bpy.data.materials.new("picture")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("picture", TEXELS, TEXELS)
    node.image.generated_type = "COLOR_GRID"
    tree = material.node_tree
    tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    ball.data.materials.append(material)
    ball.data.calc_loop_triangles()
    STORY["triangles"] = len(ball.data.loop_triangles)
    bpy.context.view_layer.objects.active = None
    with in_view():
        bpy.ops.view3d.view_all()
    tool("polygon_object")
    yield 3 * SECONDS_FOR_REDRAW
    x, y = at((0.0, 0.0, 0.0))
    for number in range(5):
        STORY["part"] = f"262k triangles, stroke {number + 1}"
        left, low = x - 150 + 50 * number, y - 60 + 25 * number
        before = lights()
        yield from polygon([(left, low), (left + 60, low), (left + 60, low + 50), (left, low + 50)], "RET")
        made(f"heavy {number + 1}", before)
    look("9_heavy")


def story():
    """The steps; each yield waits that many seconds while Blender runs on."""
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    STORY["enabled"] = PACKAGE in bpy.context.preferences.addons
    trace()
    for part in (open_box, polygons, shapes, other_views, heavy):
        STORY["part"] = part.__name__
        yield from part()
        STORY[f"left after {part.__name__}"] = len(window().modal_operators)
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
