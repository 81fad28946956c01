# SPDX-License-Identifier: GPL-3.0-or-later
"""Creation from whatever a file may hold, and operators with extreme values in each of their properties.

Run by test_extremes.py: `python extreme_story.py FOLDER`. Writes FOLDER/extremes.json: what came of each creation, and
which values of which property ended in a traceback, wrote something although they were refused, or wrote numbers that
are none.
"""

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
import numpy as np
from extreme_scenes import SCENES
from operator_story import call
from survival_actions import choose, meshes
from survival_log import Log
from survival_scene import build_start, load_extension
from survival_state import content, difference

CREATORS = ("create_from_selection", "create_from_scene")
WORDS = (
    "",
    "\0",
    "nosuch",
    20_000 * "x",
    "é名",
    "../../x",
    "1 2 3",
    "nan 0 0, 1 0 0, 0 1 0",
    "1e308 0 0, 0 1 0",
    ", ,,",
)
NUMBERS = {"INT": (0, -1, 1), "FLOAT": (math.nan, math.inf, -math.inf, 0.0, -1.0, 1e-38)}
STROKES = {
    "draw_polygon": {"points": "-1 -1 -3, 1 -1 -3, 1 1 -3", "normals": "0 0 1"},
    "draw_rectangle": {"points": "-1 -1 -3, 1 1 -3", "normals": "0 0 1"},
    "draw_extrude": {"edge": "-1 -1 -3, 1 -1 -3", "points": "0 0 -3", "normals": "0 0 1"},
    "draw_cut": {"points": "-1 0 -3, 1 0.5 -3", "normals": "0 0 1"},
    "draw_erase": {"points": "2.5 2.5 -3", "normals": "0 0 1"},
}
# They render, bake grids, open a browser or take a value from the window; creation has its own table.
LEFT_OUT = ("bake", "bake_grid", "create_", "draw_key", "fix_", "light_scene", "open_", "show_licences", "tag_thin")


def created(name, build, log):
    """What came of making lights of one scene."""
    told = {}
    for creator in CREATORS:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        values = build() or {}
        before, mode = content(), bpy.context.mode
        result, said = call(creator, log, values)
        told[creator] = {
            "result": result,
            "said": said,
            "lights": sum(len(thing.data.polygons) for thing in light_meshes()),
            "unchanged": not difference(before, content()) and bpy.context.mode == mode,
            "finite": _finite(),
        }
    return told


def light_meshes():
    """Those of the file, in view or not."""
    return [thing for thing in bpy.data.objects if "vlm_schema" in thing]


def _finite():
    for thing in light_meshes():
        places = np.zeros(3 * len(thing.data.vertices), np.float32)
        thing.data.vertices.foreach_get("co", places)
        colors = [tuple(each.color) for each in thing.data.attributes["vlm_color"].data]
        factors = [*thing["vlm_hue"], thing["vlm_strength"]]
        if not (np.isfinite(places).all() and np.isfinite(colors).all() and np.isfinite(factors).all()):
            return False
    return True


def values_of(prop):
    """Extreme values of one property of an operator."""
    if prop.type == "STRING":
        return WORDS
    if prop.type not in NUMBERS:
        return ()
    numbers = (*NUMBERS[prop.type], prop.hard_min, prop.hard_max)
    count = getattr(prop, "array_length", 0)
    return [(number,) * count for number in numbers] if count else numbers


def faults(name, folder, log):
    """What went wrong with extreme values in the properties of one operator."""
    found = []
    rna = getattr(bpy.ops.vlm, name).get_rna_type()
    fresh = False
    for prop in (each for each in rna.properties if each.identifier != "rna_type"):
        for value in values_of(prop):
            if not fresh:
                bpy.ops.wm.open_mainfile(filepath=str(folder / "lit.blend"))
                choose(meshes(True) + meshes(False))
                before = content()
            result, said = call(name, log, {**STROKES.get(name, {}), prop.identifier: value})
            fresh = not difference(before, content())
            case = f"{prop.identifier}={str(value)[:60]}"
            if result == "raised" or "Traceback" in said:
                found.append(f"{case} ended in a traceback: {said[-300:]}")
            elif result != "FINISHED" and not fresh:
                found.append(f"{case} was refused and changed {difference(before, content())}")
            elif not _finite():
                found.append(f"{case} wrote numbers that are none")
            elif len(said) > 1000:
                found.append(f"{case} is answered by {len(said)} characters")
    return found


def main(folder):
    log = Log(folder / "extremes.log")
    load_extension()
    told = {"created": {name: created(name, build, log) for name, build in SCENES.items()}}
    build_start("room", folder / "room.blend")
    choose(meshes())
    bpy.ops.vlm.create_from_selection(target_triangles=20)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "lit.blend"))
    names = [name for name in sorted(dir(bpy.ops.vlm)) if not name.startswith(LEFT_OUT)]
    told["faults"] = {name: faults(name, folder, log) for name in names}
    (folder / "extremes.json").write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
