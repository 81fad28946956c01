# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension taken out and put in again, twice, and presets kept, used and removed.

Run by test_registration.py: `python registration_story.py FOLDER`. Writes FOLDER/registration.json.
"""

import json
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active
from operator_story import call
from survival_log import Log
from survival_scene import PACKAGE, ROOT, load_extension

OWNERS = ("Scene", "Object", "Mesh", "Material", "World", "Light", "WindowManager")
PRESETS = "virtual_light_mesh"
TIMES = 2


def ours():
    """Whatever in this Blender is ours."""
    found = [f"type {name}" for name in dir(bpy.types) if "VLM" in name]
    found += [f"{owner}.{name}" for owner in OWNERS for name in dir(getattr(bpy.types, owner)) if "vlm" in name.lower()]
    found += [f"operator {name}" for name in dir(bpy.ops.vlm) if not name.startswith("_")]
    found += [f"presets {path}" for path in bpy.utils.preset_paths(PRESETS) if path.startswith(str(ROOT))]
    for name, handlers in ((name, getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers)):
        if isinstance(handlers, list):
            found += [f"handler {name} {each.__name__}" for each in handlers if PACKAGE in each.__module__]
    for name in dir(bpy.types):
        for draw in getattr(getattr(getattr(bpy.types, name), "draw", None), "_draw_funcs", ()):
            found += [f"in menu {name}"] if PACKAGE in draw.__module__ else []
    for mode, tools in VIEW3D_PT_tools_active._tools.items():
        found += [f"tool {mode} {name}" for name in re.findall(r"idname='(vlm\.\w+)'", str(tools))]
    return sorted(found)


def presets(log):
    """What keeping, using and removing a preset does."""
    scene = bpy.context.scene
    scene.vlm.samples, scene.vlm.vlm_settings.tolerance = 7, 0.125
    scene.render.resolution_x = 123
    told = {"kept": call("add_preset", log, {"name": "My Own"})}
    call("add_preset", log, {"name": "../../Other"})
    found = [path for folder in bpy.utils.preset_paths(PRESETS) for path in Path(folder).glob("*.py")]
    paths = [path for path in found if path.stem == "My_Own"]
    told["files"] = [str(path) for path in found if not str(path).startswith(str(ROOT))]
    told["lines"] = [line for line in paths[0].read_text().splitlines() if line.strip()]
    scene.vlm.samples, scene.vlm.vlm_settings.tolerance, scene.render.resolution_x = 1, 0.5, 64
    bpy.ops.script.execute_preset(filepath=str(paths[0]), menu_idname="VLM_PT_presets")
    told["used"] = [scene.vlm.samples, scene.vlm.vlm_settings.tolerance, scene.render.resolution_x]
    told["removed"] = call("add_preset", log, {"name": "My Own", "remove_name": True})
    told["left"] = [str(path) for path in paths if path.exists()]
    told["shipped removed"] = call("add_preset", log, {"name": "Quick Look", "remove_name": True})
    return told


def main(folder):
    log = Log(folder / "registration.log")
    told = {"before": ours()}
    module = load_extension()
    told["in"] = [ours()]
    told["out"] = []
    for _ in range(TIMES):
        module.unregister()
        told["out"].append(ours())
        module.register()
        told["in"].append(ours())
    told["presets"] = presets(log)
    (folder / "registration.json").write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
