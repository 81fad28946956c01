# SPDX-License-Identifier: GPL-3.0-or-later
"""Our operators found by scan, and random sound parameters for any of them."""

import re

import bpy
from survival_actions import choose, edit, meshes, some
from survival_scene import ROOT
from survival_strokes import STROKES

SMALL_INT, SMALL_FLOAT = 24, 4.0
IDNAME = re.compile(r'^\s+bl_idname = "vlm\.(\w+)"', re.MULTILINE)

BUDGETS = {"target_triangles": lambda random: random.choice((1, 7, 30)), "samples_per_light": lambda random: 1}
"""Properties that any operator may have and whose whole range would take long."""


def _finding(random):
    """Some finding of the last check that names faces, where there is one."""
    findings = bpy.context.scene.vlm.findings
    named = [index for index, finding in enumerate(findings) if finding.marks]
    return {"index": random.choice(named or [0])}


OWN = {
    "add_preset": lambda random: {"name": f"preset {random.getrandbits(32)}"},
    "select_offenders": _finding,
    **STROKES,
}
"""Parameters of single operators, by name: functions of the random numbers."""

AFTER = {
    "clear_bake": "bake",
    "clear_tag": "assign_tag",
    "stop_following": "follow_source",
    "unlink_receiver": "link_receiver",
    "unlock_lights": "lock_lights",
}
"""Operators that need what another one makes."""

NOT_ALONE = {"open_documentation": "opens a browser", "draw_key": "works while a light is being drawn"}
"""Operators that the campaign leaves out, with the reason."""


def operator_names():
    """Names under `vlm.` as the files of operators/ give them."""
    texts = (path.read_text() for path in sorted((ROOT / "operators").glob("*.py")))
    return sorted(name for text in texts for name in IDNAME.findall(text))


def parameters(name, random):
    """Values of the operator's properties, some random, the others their defaults.

    None is left out: Blender gives those the values of the last call where a call adds an undo step.
    """
    made = OWN.get(name)
    if made is not None:
        return made(random)
    properties = getattr(bpy.ops.vlm, name).get_rna_type().properties
    found = {}
    for each in properties:
        if each.identifier in BUDGETS:
            found[each.identifier] = BUDGETS[each.identifier](random)
        elif not each.is_readonly and each.type in VALUES and random.random() < 0.7:
            found[each.identifier] = VALUES[each.type](each, random)
        elif not each.is_readonly and each.type in (*VALUES, "STRING"):
            found[each.identifier] = _default(each)
    return found


def _default(each):
    if each.type == "ENUM" and each.is_enum_flag:
        return each.default_flag
    return list(each.default_array) if getattr(each, "is_array", False) else each.default


def _number(each, random, draw, smallest, largest):
    low, high = max(each.hard_min, each.soft_min, smallest), min(each.hard_max, each.soft_max, largest)
    values = [draw(low, max(low, high)) for _ in range(max(each.array_length, 1))]
    return values if each.is_array else values[0]


def _choice(each, random):
    names = [item.identifier for item in each.enum_items]
    if each.is_enum_flag:
        return set(random.sample(names, random.randint(1, len(names))))
    return random.choice(names) if names else each.default


def _truth(each, random):
    values = [random.random() < 0.5 for _ in range(max(each.array_length, 1))]
    return values if each.is_array else values[0]


VALUES = {
    "INT": lambda each, random: _number(each, random, random.randint, 0, SMALL_INT),
    "FLOAT": lambda each, random: _number(each, random, random.uniform, -SMALL_FLOAT, SMALL_FLOAT),
    "BOOLEAN": _truth,
    "ENUM": _choice,
}


def prepare(random):
    """A context in which some of our operators have something to do."""
    lights = [thing for thing in meshes(True) if thing.visible_get()]
    others = [thing for thing in meshes(False) if thing.visible_get()]
    editable = [thing for thing in lights if not thing.library and len(thing.data.polygons)]
    kind = random.choice(("lights", "others", "both", "edit", "edit source", "as it is"))
    if kind == "lights":
        choose(some(random, lights))
    elif kind == "others":
        choose(some(random, others))
    elif kind == "both":
        choose(some(random, lights) + some(random, others))
    elif kind == "edit" and editable:
        edit(random.choice(editable), random, random.random() < 0.3)
    elif kind == "edit source" and others:
        sources = [thing for thing in others if not thing.library and len(thing.data.polygons)]
        if sources:
            edit(random.choice(sources), random)
