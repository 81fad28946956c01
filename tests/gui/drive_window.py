# SPDX-License-Identifier: GPL-3.0-or-later
"""Does what a new user does, with the mouse and keys where it can.

Played by test_window.py; see window_steps.py. A screenshot after each step.
"""

import bpy
from window_steps import (
    FOLDER,
    MODULE,
    STORY,
    close_picture,
    in_view,
    install,
    light_meshes,
    look,
    nothing_runs,
    picture_is_shown,
    press,
    redraw,
    run,
    show_sidebar,
    until,
    view,
)

GRID = 700
FRAMES_UNTIL_SHOWN = 4


def effects_tab():
    """A tab that holds the panel Effects alone, opened: Blender remembers that the panel itself begins closed."""
    panel = bpy.types.VLM_PT_effects
    members = {"bl_label": panel.bl_label, "draw": panel.draw, "bl_category": "VLM Effects", "bl_options": set()}
    bpy.utils.register_class(type("VLM_PT_effects_alone", panel.__bases__, members))
    return members["bl_category"]


def there_is_a_light_mesh():
    return bool(light_meshes())


def there_is_none():
    return not light_meshes()


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
    STORY["enabled"] = install()
    yield from show_sidebar()
    yield from look("1_default_file")

    bpy.context.scene.render.resolution_percentage = 25  # a software renderer would need minutes for all pixels
    with in_view():
        STORY["first button"] = sorted(bpy.ops.vlm.light_scene("INVOKE_DEFAULT"))
    yield from until(there_is_a_light_mesh)
    yield from until(picture_is_shown)
    yield from look("2_first_button")
    bpy.data.images["Render Result"].save_render(str(FOLDER / "first_picture.png"))
    close_picture()
    for thing in light_meshes():
        bpy.data.objects.remove(thing)

    room()
    bpy.ops.ed.undo_push(message="room")
    bpy.ops.object.select_all(action="SELECT")
    with in_view():
        STORY["create"] = sorted(bpy.ops.vlm.create_from_selection("INVOKE_DEFAULT", target_triangles=200))
    yield from until(there_is_a_light_mesh)
    yield from look("3_created")
    STORY["lights"] = {thing.name: len(thing.data.polygons) for thing in light_meshes()}

    press("Z", ctrl=True)
    yield from until(there_is_none)
    yield from look("4_undone")
    press("Z", ctrl=True, shift=True)
    yield from until(there_is_a_light_mesh)
    yield from look("5_redone")

    with in_view():
        STORY["check"] = sorted(bpy.ops.vlm.check("INVOKE_DEFAULT"))
    yield from until(nothing_runs)
    with in_view():
        STORY["light scene"] = sorted(bpy.ops.vlm.light_scene("INVOKE_DEFAULT"))
    yield from until(picture_is_shown)
    yield from look("6_lit")
    STORY["engine"] = bpy.context.scene.render.engine
    bpy.data.images["Render Result"].save_render(str(FOLDER / "render_result.png"))

    close_picture()
    space = view()[0].spaces.active
    space.shading.type = "RENDERED"
    yield from look("7_rendered_view")
    space.shading.type = "SOLID"

    yield from show_sidebar(effects_tab())
    yield from look("7_effects")
    bpy.utils.unregister_class(bpy.types.VLM_PT_effects_alone)

    eevee_picture("eevee_with")
    for thing in light_meshes():
        bpy.data.objects.remove(thing)
    eevee_picture("eevee_without")
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=GRID, y_subdivisions=GRID, size=2.0)
    bpy.context.object.display_type = "BOUNDS"
    with in_view():
        STORY["long work"] = sorted(bpy.ops.vlm.create_from_selection("INVOKE_DEFAULT", target_triangles=100))
    for _ in range(FRAMES_UNTIL_SHOWN):
        yield from redraw()
    STORY["ran at Esc"] = not nothing_runs()
    yield from look("8_progress")
    press("ESC")
    yield from until(nothing_runs)
    STORY["after Esc"] = [thing.name for thing in light_meshes()]

    bpy.ops.preferences.addon_disable(module=MODULE)
    yield from look("9_disabled")


run(story())
