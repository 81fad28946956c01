# SPDX-License-Identifier: GPL-3.0-or-later
"""The situations in which drive_authoring.py presses buttons: what is there, and what is selected or edited."""

import bpy
from window_steps import choose, in_view, light_meshes

BUDGET = 60
SMALLER_BUDGET = 10
"""Less than the cube's and the sheet's faces: what is made again is another light mesh."""
OWN_COLOR = (0.2, 0.3, 0.4, 1.0)
"""Of one light: recoloring it changes something."""


def scene():
    """The default cube, which moves, and a sheet that turns its back to it."""
    bpy.ops.mesh.primitive_plane_add(size=2.0, location=(1.9, 0.0, 0.0), rotation=(0.0, 1.5708, 0.0))
    bpy.context.object.name = "Sheet"
    cube().active_material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.1, 0.1, 1.0)
    for frame in (1, 2):
        cube().keyframe_insert("location", frame=frame)
    bpy.context.scene.vlm.target_triangles = BUDGET
    bpy.context.scene.render.resolution_percentage = 10
    bpy.context.scene.vlm.samples = 1


def cube():
    return bpy.data.objects["Cube"]


def first_lights():
    """The ones of cube and sheet."""
    return min(light_meshes(), key=lambda each: each.name)


def values_of_lights(name):
    return first_lights().data.attributes[name].data


def visible_selected():
    choose(cube(), bpy.data.objects["Sheet"])


def lights_selected():
    if not light_meshes():
        visible_selected()
        with in_view():
            bpy.ops.vlm.create_from_selection("EXEC_DEFAULT", target_triangles=BUDGET)
        bpy.context.scene.vlm.target_triangles = SMALLER_BUDGET
    choose(first_lights())
    values_of_lights("vlm_color")[0].color = OWN_COLOR


def lights_wrong():
    """Findings of both sorts: one that an artist may have meant, and one that Fix All mends."""
    choose(first_lights())
    values_of_lights("vlm_color")[0].color = (3.0, 3.0, 3.0, 1.0)
    if "story_turned" not in first_lights():
        first_lights()["story_turned"] = True
        first_lights().data.polygons[1].flip()
    bpy.context.scene.vlm.findings.clear()


def lights_checked():
    lights_wrong()
    with in_view():
        bpy.ops.vlm.check("EXEC_DEFAULT")


def lights_edited():
    choose(first_lights())
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")


def both_selected():
    choose(first_lights(), cube())


def cube_left_out():
    choose(first_lights(), cube())
    with in_view():
        bpy.ops.vlm.link_receiver("EXEC_DEFAULT")


def lights_locked():
    choose(first_lights())
    with in_view():
        bpy.ops.vlm.lock_lights("EXEC_DEFAULT")


def lights_tagged():
    choose(first_lights(), cube(), bpy.data.objects["Sheet"])
    with in_view():
        bpy.ops.vlm.assign_tag("EXEC_DEFAULT", tag=7)


def copies_with_tags():
    """The cube and its lights, tagged, copied to another place: both copies have the ids of the first."""
    lights_tagged()
    for thing in (first_lights(), cube()) if "Cube.001" not in bpy.data.objects else ():
        copy = thing.copy()
        copy.data = thing.data.copy()
        copy.location.x += 5.0
        bpy.context.collection.objects.link(copy)
    choose(first_lights())


def two_light_meshes():
    """Of different strength: the button gives both that of the first, before the artist adjusts it."""
    copies_with_tags()
    choose(*light_meshes())
    for number, thing in enumerate(light_meshes()):
        thing["vlm_strength"] = 1.0 + number


def lights_that_follow():
    choose(first_lights(), cube())
    with in_view():
        bpy.ops.vlm.follow_source("EXEC_DEFAULT")
    choose(first_lights())


def faces_edited():
    choose(cube())
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")


SITUATIONS = (
    (
        "objects selected",
        visible_selected,
        (
            *("create_from_selection", "create_from_collection", "create_from_scene", "light_scene", "paint_detail"),
            *("bake", "open_documentation", "copy_diagnostics", "show_licences"),
        ),
    ),
    (
        "lights selected",
        lights_selected,
        (
            *("create_again", "lock_lights", "pick_color", "fill_color", "multiply_color", "shift_hue"),
            *("gradient_color", "recolor_from_materials", "pair_tags", "tag_thin"),
            *("show_light_grid", "bake_grid", "check_bake", "clear_bake"),
        ),
    ),
    ("lights wrong", lights_wrong, ("check",)),
    ("lights checked", lights_checked, ("select_offenders", "fix_findings")),
    ("lights edited", lights_edited, ("fill_color", "multiply_color", "assign_tag", "lock_lights")),
    ("both selected", both_selected, ("assign_tag", "link_receiver", "follow_source")),
    ("object left out", cube_left_out, ("unlink_receiver",)),
    ("lights locked", lights_locked, ("unlock_lights",)),
    ("lights tagged", lights_tagged, ("clear_tag",)),
    ("copies with tags", copies_with_tags, ("repair_tags",)),
    ("two light meshes", two_light_meshes, ("set_strength",)),
    ("lights that follow", lights_that_follow, ("stop_following",)),
    ("faces edited", faces_edited, ("draw_fill",)),
)
"""Name, what arranges it, and the operators that are pressed in it."""
