# SPDX-License-Identifier: GPL-3.0-or-later
"""Switches the overlays of a light mesh on, one after the other.

Played by test_overlay_window.py; see window_steps.py. Takes a screenshot of each overlay.
"""

import bpy
from window_steps import STORY, at, choose, in_view, install, light_meshes, look, redraw, run, view, window

LIGHTS = 60
RADIUS = 2.0


def red_ball():
    """A red ball alone in the file, with its light mesh."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=RADIUS)
    material = bpy.data.materials.new("red")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.02, 0.02, 1.0)
    bpy.context.object.data.materials.append(material)
    bpy.context.object["vlm_tag"] = 3
    with in_view():
        STORY["created"] = sorted(bpy.ops.vlm.create_from_scene(target_triangles=LIGHTS))


def ball_on_the_screen():
    """Where its middle shows, pixels from the left and from the top, and its radius there."""
    yield from redraw()
    up = view()[0].spaces.active.region_3d.view_matrix.inverted().col[1].to_3d()
    (x, y), (_, top) = at((0.0, 0.0, 0.0)), at(RADIUS * up)
    STORY["ball"] = [x, window().height - y, top - y]


def handlers():
    return len(bpy.app.handlers.depsgraph_update_post)


def turned(mode):
    """The light mesh in a mode; its faces turned over on the way into Edit Mode."""
    if mode == "EDIT":
        choose(light_meshes()[0])
    with in_view():
        bpy.ops.object.mode_set(mode=mode)
        if mode == "EDIT":
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.mesh.flip_normals()
            bpy.ops.mesh.select_all(action="DESELECT")


def story():
    STORY["enabled"] = install()
    red_ball()
    yield from ball_on_the_screen()
    STORY["handlers"] = [handlers()]
    view()[0].spaces.active.overlay.show_cursor = False
    yield from look("off")
    shown = bpy.context.window_manager.vlm_overlay
    shown.show, shown.sides, shown.findings, shown.opacity = True, False, False, 1.0
    STORY["handlers"].append(handlers())
    yield from look("color")
    shown.fill = "TAGS"
    yield from look("tags")
    shown.fill = "COLOR"
    for mode in ("EDIT", "OBJECT"):
        turned(mode)
        shown.sides = mode == "EDIT"
        yield from look(f"turned_{mode.lower()}")
    shown.fill, shown.sides, shown.grid_place = "NONE", False, "Y"
    with in_view():
        STORY["grid"] = sorted(bpy.ops.vlm.show_light_grid())
    yield from look("grid")
    shown.show = False
    STORY["handlers"].append(handlers())
    yield from look("off_again")


run(story())
