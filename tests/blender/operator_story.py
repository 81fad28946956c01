# SPDX-License-Identifier: GPL-3.0-or-later
"""Every operator under `vlm.` called by a script in each situation that artists meet, with undo and redo.

Run by test_operators.py: `python operator_story.py FOLDER [NAME ...]`. Writes FOLDER/operators.json: for each
operator what Blender knows of it, how it refuses an empty file, and what its first success did.
"""

import json
import sys
import traceback
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
from survival_actions import choose, edit, meshes
from survival_log import Log
from survival_parameters import AFTER, OWN
from survival_scene import build_start, load_extension
from survival_state import content, difference

BUDGET = 40
SITUATIONS = {
    "light mesh selected": lambda lights, others: choose(lights),
    "light mesh edited": lambda lights, others: edit(lights[0], Random(1), everything=True),
    "objects selected": lambda lights, others: choose(others),
    "both selected": lambda lights, others: choose(lights + others),
    "object edited": lambda lights, others: edit(others[0], Random(1)),
    "nothing selected": lambda lights, others: choose([]),
}
CHANGING = {
    "multiply_color": {"factor": 0.5},
    "set_strength": {"strength": 2.0},
    "shift_hue": {"turn": 1.0},
}
"""Values of operators whose defaults change nothing."""


def _forget_findings():
    bpy.context.scene.vlm.findings.clear()


def _share_a_tag():
    """A copy of an object, apart from the lights of the first, leaves out the same id."""
    cube, lights = bpy.data.objects["Cube"], bpy.data.objects["Lights"]
    choose([cube, lights])
    bpy.ops.vlm.pair_tags()
    for thing in (cube, lights):
        copy = thing.copy()
        copy.data = thing.data.copy()
        copy.location.x += 20.0
        bpy.context.scene.collection.objects.link(copy)
    choose([lights])


def _add_a_sheet():
    """A sheet in the room that the lights of the floor shine on from below."""
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    bpy.context.object.name = "Sheet"
    bpy.ops.vlm.create_from_selection(target_triangles=BUDGET)
    bpy.data.objects["VLM Sheet"].location.z = -0.01
    choose(meshes(True))


BEFORE = {"check": _forget_findings, "repair_tags": _share_a_tag, "tag_thin": _add_a_sheet}
"""What gives operators something to do that have nothing to do in the scene as it is."""


def prepare(folder):
    """Two scenes: one with a light mesh that the last check complained of, one without any object."""
    build_start("room", folder / "room.blend")
    cube = bpy.data.objects["Cube"]
    cube.keyframe_insert("location", frame=1)
    cube.location.x += 0.5
    cube.keyframe_insert("location", frame=10)
    choose(meshes())
    bpy.ops.vlm.create_from_selection(target_triangles=BUDGET)
    (lights,) = meshes(True)
    lights.data.attributes["vlm_color"].data[0].color = (2.0, 2.0, 2.0, 1.0)
    lights.data.attributes["vlm_tag"].data[0].value = 1
    lights.data.flip_normals()
    lights.name = "Lights"
    bpy.ops.vlm.check()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "lit.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "empty.blend"))


def open_situation(folder, situation, before=None):
    """The scene with a light mesh, in one situation, with an undo step to come back to.

    before: what is changed in the situation first.
    """
    bpy.ops.wm.open_mainfile(filepath=str(folder / "lit.blend"))
    SITUATIONS[situation](meshes(True), meshes(False))
    if before is not None:
        before()
    bpy.ops.ed.undo_push(message=situation)


def call(name, log, values, how="EXEC_DEFAULT"):
    """(result, what was said) of one call; the result of a refusal is "refused", of an exception "raised"."""
    log.since()
    try:
        result = next(iter(getattr(bpy.ops.vlm, name)(how, True, **values)))
    except (RuntimeError, TypeError) as error:
        result = "raised" if "Traceback" in str(error) or isinstance(error, TypeError) else "refused"
        return result, str(error)
    return result, log.since()


def known(name):
    """What Blender knows of an operator."""
    rna = getattr(bpy.ops.vlm, name).get_rna_type()
    properties = [each for each in rna.properties if each.identifier != "rna_type" and not each.is_hidden]
    unnamed = [each.identifier for each in properties if not (each.name and each.description)]
    undo = "UNDO" in getattr(bpy.types, rna.identifier).bl_options
    return {"label": rna.name, "description": rna.description, "unexplained": unnamed, "undo": undo}


def first_success(name, folder, log):
    """What the operator did in the first situation that it accepts, undone, redone and done again."""
    refusals = {}
    for situation in SITUATIONS:
        open_situation(folder, situation, BEFORE.get(name))
        if name in AFTER:
            call(AFTER[name], log, {})
        values = OWN[name](Random(2)) if name in OWN else CHANGING.get(name, {})
        before = content()
        result, said = call(name, log, values)
        if result != "FINISHED":
            refusals[situation] = (result, said, difference(before, content()))
            continue
        after = content()
        told = {"situation": situation, "said": said, "changed": difference(before, after)}
        if before != after:
            bpy.ops.ed.undo()
            told["undone"] = difference(before, content())
            bpy.ops.ed.redo()
            told["redone"] = difference(after, content())
            bpy.ops.ed.undo()
            again, _ = call(name, log, values)
            told["again"] = [again, difference(after, content())]
        open_situation(folder, situation)
        if name in AFTER:
            call(AFTER[name], log, {})
        told["invoked"] = call(name, log, values, "INVOKE_DEFAULT")
        return told, refusals
    return None, refusals


def main(folder, names):
    log = Log(folder / "operators.log")
    load_extension()
    prepare(folder)
    told = {}
    for name in names or sorted(dir(bpy.ops.vlm)):
        bpy.ops.wm.open_mainfile(filepath=str(folder / "empty.blend"))
        try:
            told[name] = {"known": known(name), "empty": call(name, log, {})}
            told[name]["success"], told[name]["refusals"] = first_success(name, folder, log)
        except Exception:  # noqa: BLE001 (told by the test of this operator)
            told[name] = {"exception": traceback.format_exc()}
        (folder / "operators.json").write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
