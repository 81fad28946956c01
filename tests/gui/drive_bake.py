# SPDX-License-Identifier: GPL-3.0-or-later
"""Disturbs long work: edits, undoes, deletes, saves, loads, disables while it runs.

Played by test_bake_window.py; see window_steps.py.
"""

import bpy
from window_steps import (
    FOLDER,
    MODULE,
    SECONDS_FOR_REDRAW,
    STORY,
    in_view,
    install,
    look,
    nothing_runs,
    press,
    redraw,
    run,
    show_sidebar,
    until,
    window,
    write_story,
)

GRID = 200
LIGHTS = 100


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


def disturbed(name, disturb, end=lambda: until(nothing_runs)):
    """One story: a large file, work on it, `disturb` in the middle of it, and what there is afterwards."""
    yield from large_file()
    told = STORY[name] = {"began": begin()}
    yield 0.3
    told["ran"] = not nothing_runs()
    result = disturb()
    yield 0.3
    told["ran after"] = not nothing_runs()
    yield from look(name)
    yield from end()
    yield SECONDS_FOR_REDRAW
    told |= {"lights": lights(), "orphans": orphans(), "objects": len(window().scene.objects), "said": result}
    told["scene"] = window().scene.name
    write_story()


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
    yield from show_sidebar()
    yield from look("german")
    tell = bpy.app.translations.pgettext_iface
    STORY["german"] = [tell("Bake Light Grid", "Operator"), tell("Target Triangles")]
    STORY["german of ours"] = [tell("Tags", "VLM"), tell("Light Polygon", "Operator"), tell("Nothing is baked", "VLM")]
    view.language = "en_US"


def story():
    """The steps; each yield waits that many seconds while Blender runs on."""
    STORY["enabled"] = install()
    yield from redraw()
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
    yield from until(nothing_runs)
    STORY["after all"]["lights"] = lights()


run(story())
