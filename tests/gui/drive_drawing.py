# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws lights into the Cornell box with mouse and keys, with each drawing tool.

Played by test_drawing_window.py; see window_steps.py. FOLDER holds cornell_box.blend. STORY: what each stroke made and
how long our own callbacks took; screenshots.
"""

import math
import sys
import time

import bpy
import numpy as np
from window_steps import (
    FOLDER,
    MODULE,
    SECONDS_FOR_AN_EVENT,
    SECONDS_FOR_REDRAW,
    STORY,
    at,
    choose,
    click,
    drag,
    framed,
    in_view,
    install,
    light_meshes,
    look,
    move,
    press,
    run,
    view,
    window,
)

STEPS = 10
SEGMENTS, RINGS = 512, 257
"""A ball of these has 262,144 triangles."""
TEXELS = 2048

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


def line(first, last):
    shares = np.linspace(0.0, 1.0, STEPS)
    return [tuple(int(a + share * (b - a)) for a, b in zip(first, last, strict=True)) for share in shares]


def polygon(corners, end="click"):
    for corner in corners:
        click(corner)
        yield SECONDS_FOR_AN_EVENT
    click(corners[0]) if end == "click" else press(end, corners[-1])
    yield SECONDS_FOR_REDRAW


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
    """Time the callbacks of strokes, by event, and what is made ready ahead of them: wall clock, and processor time of
    the thread."""
    ahead = sys.modules[f"{MODULE}.vlm_addon.blender.drawing.draw_ahead"]
    ahead._step = timed_call(ahead._step, lambda *_: f"{STORY.get('part', '')}: ahead")
    stroke = sys.modules[f"{MODULE}.vlm_addon.blender.drawing.draw_modal"].ModalStroke
    stroke._handled = timed_call(
        stroke._handled,
        lambda self, _, event: f"{STORY.get('part', '')}: {type(self).__name__} {event.type} {event.value}",
    )


def timed_call(function, name_of):
    """`function`, whose times are kept under the name that its arguments give."""

    def timed(*values):
        wall, busy = time.perf_counter(), time.thread_time()
        try:
            return function(*values)
        finally:
            spent = (1000.0 * (time.perf_counter() - wall), 1000.0 * (time.thread_time() - busy))
            STORY["milliseconds"].setdefault(name_of(*values), []).append([round(value, 2) for value in spent])

    return timed


def open_box():
    """The Cornell box without its lights, through its camera."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "cornell_box.blend"))
    yield SECONDS_FOR_REDRAW
    for thing in light_meshes():
        bpy.data.objects.remove(thing)
    choose()
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
    move(framed(0.32, 0.33))
    yield SECONDS_FOR_REDRAW
    yield from look("1_polygon")
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
    yield from look("2_ten_polygons")
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
    yield from drag(line(framed(0.565, 0.265), framed(0.745, 0.565)), look("3_rectangle"))
    made("rectangle", before)
    tool("extrude_object")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from drag(line(framed(0.745, 0.335), framed(0.9, 0.36)), look("4_extrude"))
    made("round the corner", before)
    tool("cut_object")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from drag(line(framed(0.38, 0.26), framed(0.4, 0.39)))
    made("cut", before)
    tool("erase_object")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from drag(line(framed(0.58, 0.3), framed(0.73, 0.31)), look("5_erase"))
    made("erase", before)
    yield from look("6_erased")


def other_views():
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
    tool("polygon_edit_mesh")
    yield SECONDS_FOR_REDRAW
    before = lights()
    yield from polygon([framed(*place) for place in ((0.56, 0.9), (0.66, 0.905), (0.65, 0.945), (0.55, 0.945))])
    yield from look("7_edit_mode")
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
    yield from look("8_orthographic")


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
    STORY["part"] = "262k triangles"
    move((x, y))
    yield 4 * SECONDS_FOR_REDRAW
    for number in range(5):
        STORY["part"] = f"262k triangles, stroke {number + 1}"
        left, low = x - 150 + 50 * number, y - 60 + 25 * number
        before = lights()
        yield from polygon([(left, low), (left + 60, low), (left + 60, low + 50), (left, low + 50)], "RET")
        made(f"heavy {number + 1}", before)
    yield from look("9_heavy")


def story():
    """The steps; each yield waits that many seconds while Blender runs on."""
    STORY.update({"enabled": install(), "made": {}, "milliseconds": {}})
    trace()
    for part in (open_box, polygons, shapes, other_views, heavy):
        STORY["part"] = part.__name__
        yield from part()
        STORY[f"left after {part.__name__}"] = len(window().modal_operators)


run(story())
