# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 5.5 of seed 002 by mouse and keys: the red wall of the Cornell box bounces blue, five times as strong.

Played by test_bounce_window.py; see window_steps.py. FOLDER holds cornell_box.blend. Writes radiances as arrays: direct
light alone, before and after; all light before, after, and with the block left out; and what surface each pixel shows.
"""

import bpy
import numpy as np
from sidebar_steps import adjust_last, press_button, whole_sidebar
from window_steps import (
    FOLDER,
    SECONDS_FOR_REDRAW,
    STORY,
    at,
    choose,
    drag,
    in_frame,
    in_view,
    install,
    light_meshes,
    look,
    picture_is_ready,
    press,
    redraw,
    render_without_window,
    run,
    type_text,
    until,
    write_story,
)

PERCENT = 30
SAMPLES = 4
SURFACES = ("Floor, ceiling, back", "Red wall", "Green wall", "Tall block", "Sphere", "Lamp panel")
MINUS_120_DEGREES = "-120"
FACTOR = "5"
LIFTED = "0.4"
"""By how many metres the lights of the floor are lifted in front of it."""


def lights():
    return light_meshes()[0]


def open_box():
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "cornell_box.blend"), load_ui=False)
    yield from redraw()
    yield from whole_sidebar()
    scene = bpy.context.scene
    scene.render.engine = "VLM_ENGINE"
    scene.render.resolution_percentage = PERCENT
    scene.vlm.samples = SAMPLES
    bpy.context.preferences.view.smooth_view = 0
    render_without_window()
    choose(lights())
    with in_view():
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
    bpy.ops.ed.undo_push(message="the box")
    yield from redraw()


def picture(name, indirect="auto"):
    """Render by F12 and keep the radiances, (height, width, 3) from the top, as an array."""
    scene = bpy.context.scene
    scene.vlm.effects.indirect_light = indirect
    STORY["renders"] = 0
    press("F12")
    yield from until(picture_is_ready)
    result = bpy.data.images["Render Result"]
    result.save_render(str(FOLDER / f"{name}.png"))
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    result.save_render(str(FOLDER / f"{name}.exr"))
    settings.file_format = "PNG"
    saved = bpy.data.images.load(str(FOLDER / f"{name}.exr"))
    width, height = saved.size
    values = np.array(saved.pixels[:], np.float32).reshape(height, width, 4)[::-1, :, :3]
    bpy.data.images.remove(saved)
    np.save(FOLDER / f"{name}.npy", values)
    STORY["pictures"].append(name)
    write_story()


def surfaces(height, width):
    """(height, width): the number in SURFACES of what a pixel's middle shows, -1 for nothing."""
    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    eye = scene.camera.matrix_world.translation
    found = np.full((height, width), -1)
    for row in range(height):
        for column in range(width):
            place = in_frame((column + 0.5) / width, (row + 0.5) / height)
            hit, *_, thing, _ = scene.ray_cast(depsgraph, eye, place - eye)
            found[row, column] = SURFACES.index(thing.name) if hit and thing.name in SURFACES else -1
    return found


def keep_surfaces():
    """Light meshes are passed by hiding them from the rays."""
    lights().hide_viewport = True
    side = bpy.context.scene.render.resolution_x * PERCENT // 100
    np.save(FOLDER / "surfaces.npy", surfaces(side, side))
    lights().hide_viewport = False


def box_around(low, high):
    """Drag a box in the view around what lies between two points of the world."""
    yield from drag([at(low), at((np.array(low) + high) / 2), at(high)])


def chosen():
    lights().update_from_editmode()
    return [polygon.index for polygon in lights().data.polygons if polygon.select]


def colors():
    return [list(each.color)[:3] for each in lights().data.attributes["vlm_color"].data]


def into_edit_mode():
    press("TAB")
    yield from until(lambda: bpy.context.mode == "EDIT_MESH")
    press("THREE")
    yield SECONDS_FOR_REDRAW


def out_of_edit_mode():
    press("TAB")
    yield from until(lambda: bpy.context.mode == "OBJECT")


def red_wall_blue():
    """The red wall's lights, chosen by a box in the front view, turned to blue and made five times as strong."""
    STORY["colors before"] = colors()
    yield from into_edit_mode()
    yield from box_around((-3.0, 0.0, -0.3), (-2.5, 0.0, 5.8))
    STORY["chosen"] = chosen()
    yield from look("1_chosen")
    STORY["pressed"] = {}
    for name, value in (("shift_hue", MINUS_120_DEGREES), ("multiply_color", FACTOR)):
        told = yield from press_button(name)
        told["adjusted"] = yield from adjust_last("number", value)
        STORY["pressed"][name] = told
        yield from look(f"2_{name}")
    yield from out_of_edit_mode()
    STORY["colors after"] = colors()


def findings():
    return [(item.kind, sum(1 for _ in item.marks)) for item in bpy.context.scene.vlm.findings]


def lift_the_floor():
    """Its lights, chosen by a box in the front view, moved upwards by keys: they stand in front of the floor then."""
    yield from into_edit_mode()
    yield from box_around((-2.4, 0.0, -0.3), (2.6, 0.0, 0.05))
    STORY["lifted"] = len(chosen())
    press("G")
    press("Z")
    yield from type_text(LIFTED)
    press("RET")
    yield SECONDS_FOR_REDRAW
    yield from out_of_edit_mode()


def check_and_fix():
    yield from lift_the_floor()
    for step, name in (("checked", "check"), ("fixed", "fix_findings")):
        STORY["pressed"][name] = yield from press_button(name)
        STORY[step] = findings()
        yield from look(f"3_{step}")
    told = yield from press_button("select_offenders")
    STORY["pressed"]["select_offenders"] = told
    STORY["offenders"] = [STORY["fixed"][0][0], chosen()]
    yield from look("4_offenders")
    yield from out_of_edit_mode()


def leave_out_the_block():
    choose(lights(), bpy.data.objects["Tall block"])
    STORY["pressed"]["link_receiver"] = yield from press_button("link_receiver")
    yield from look("5_left_out")


def story():
    STORY.update({"enabled": install(), "pictures": []})
    yield from open_box()
    keep_surfaces()
    yield from picture("direct_before", "off")
    yield from picture("before")
    yield from red_wall_blue()
    yield from picture("after")
    yield from picture("direct_after", "off")
    yield from leave_out_the_block()
    yield from picture("left_out")
    yield from check_and_fix()


run(story())
