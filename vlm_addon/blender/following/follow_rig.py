# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a rig that a light mesh takes over from its source: vertex groups, shape keys, modifiers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.scene import Float64, Int32
from ..extraction.mesh_arrays import read
from ..names import MORE_DETAIL_GROUP, NO_LIGHTS_GROUP
from ..stored_values import text
from .surface_transfer import interpolated, vertex_weights

PREFIX = "Follow: "
"""Modifiers and shape keys that following made."""
GROUPS_PROPERTY = "vlm_follow_groups"
"""Names of the vertex groups that following made, one a line; on light meshes that follow."""

COPIED = {"ARMATURE", "LATTICE", "CURVE", "WARP"}
"""Modifiers that move each vertex by its place and its weights alone: a copy does the same to the light mesh."""
SHAPING = {
    *("ARRAY", "BEVEL", "BOOLEAN", "BUILD", "DECIMATE", "EDGE_SPLIT", "MASK", "MIRROR", "MULTIRES", "REMESH", "SCREW"),
    *("SKIN", "SOLIDIFY", "SUBSURF", "TRIANGULATE", "WELD", "WIREFRAME", "NORMAL_EDIT", "WEIGHTED_NORMAL"),
    *("UV_PROJECT", "UV_WARP", "DATA_TRANSFER", "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY"),
}
"""Modifiers that make a surface and do not move it over frames by themselves."""
REPEATING = {"ARRAY", "MIRROR", "SCREW"}
"""Modifiers that put copies elsewhere: what has moved the mesh before them moves the copies otherwise."""
VIRTUAL_ARMATURE = "ARMATURE"
"""Type of a parent that deforms without a modifier."""


def is_following(thing: Any) -> bool:
    """Whether a light mesh follows its source."""
    return GROUPS_PROPERTY in thing


def mark(thing: Any) -> None:
    """From now on the light mesh follows its source."""
    thing[GROUPS_PROPERTY] = ""


def rig_problem(source: Any, depsgraph: Any) -> str | None:
    """Why copies of the source's modifiers and shape keys would not move a light mesh as they move it, or None."""
    if source.type != "MESH":
        return None
    others = [m.name for m in source.modifiers if m.show_viewport and m.type not in COPIED | SHAPING]
    if others:
        return f"its modifier {others[0]!r} cannot be copied to another mesh"
    kinds = [m.type for m in source.modifiers if m.show_viewport]
    moved = next((row for row, kind in enumerate(kinds) if kind in COPIED), len(kinds))
    if REPEATING & set(kinds[moved:]):
        return "its modifiers repeat the mesh after they have moved it"
    if source.parent_type in ("LATTICE", "CURVE"):
        return f"its parent deforms it without a modifier ({source.parent_type.lower()})"
    keys = source.data.shape_keys
    if keys is None:
        return None
    if not keys.use_relative:
        return "its shape keys are absolute"
    if len(source.evaluated_get(depsgraph).data.vertices) != len(source.data.vertices):
        return "its modifiers make other vertices than its shape keys move"
    return None


def copy_rig(thing: Any, source: Any, depsgraph: Any, corners: Int32, weights: Float64) -> None:
    """Vertex groups, shape keys and modifiers of `source` for the light mesh, whose basis is as it should be.

    corners: (v, 3) vertices of the evaluated source around the point nearest to each vertex of the light mesh; weights:
    (v, 3), summing to 1.
    """
    _copy_groups(thing, source, depsgraph, corners, weights)
    _copy_shape_keys(thing, source, corners, weights)
    _copy_modifiers(thing, source)


def remove_rig(thing: Any) -> None:
    """Take away what `copy_rig` and a binding to the surface made; the basis stays."""
    for modifier in [m for m in thing.modifiers if m.name.startswith(PREFIX)]:
        thing.modifiers.remove(modifier)
    for name in text(thing, GROUPS_PROPERTY).split("\n"):
        if name in thing.vertex_groups:
            thing.vertex_groups.remove(thing.vertex_groups[name])
    if GROUPS_PROPERTY in thing:
        del thing[GROUPS_PROPERTY]
    keys = thing.data.shape_keys
    for block in [b for b in keys.key_blocks if b.name.startswith(PREFIX)] if keys is not None else ():
        block.driver_remove("value")
        thing.shape_key_remove(block)
    keys = thing.data.shape_keys
    if keys is not None and len(keys.key_blocks) == 1:
        thing.shape_key_clear()


def add_first(thing: Any, name: str, kind: str) -> Any:
    """A new modifier before those that the artist has added, after others that following made."""
    modifier = thing.modifiers.new(PREFIX + name, kind)
    ours = sum(m.name.startswith(PREFIX) for m in thing.modifiers)
    thing.modifiers.move(len(thing.modifiers) - 1, ours - 1)
    return modifier


def _copy_groups(thing: Any, source: Any, depsgraph: Any, corners: Int32, weights: Float64) -> None:
    found = vertex_weights(source.evaluated_get(depsgraph).data, corners, weights)
    names = []
    for number, rows in found.items():
        name = source.vertex_groups[number].name
        if name in (MORE_DETAIL_GROUP, NO_LIGHTS_GROUP) or name in thing.vertex_groups:
            continue
        group = thing.vertex_groups.new(name=name)
        names.append(name)
        for row, weight in rows.items():
            group.add([row], weight, "REPLACE")
    thing[GROUPS_PROPERTY] = "\n".join(names)


def _copy_shape_keys(thing: Any, source: Any, corners: Int32, weights: Float64) -> None:
    keys = source.data.shape_keys
    if keys is None or len(keys.key_blocks) < 2:
        return
    if thing.data.shape_keys is None:
        thing.shape_key_add(name="Basis")
    basis = _positions(keys.reference_key.data)
    rest = _positions(thing.data.vertices)
    made = {keys.reference_key.name: thing.data.shape_keys.reference_key}
    for block in keys.key_blocks[1:]:
        moved = rest + interpolated(_positions(block.data) - basis, corners, weights)
        copy = thing.shape_key_add(name=PREFIX + block.name, from_mix=False)
        copy.data.foreach_set("co", np.ascontiguousarray(moved, np.float32).ravel())
        copy.slider_min, copy.slider_max = block.slider_min, block.slider_max
        copy.vertex_group = block.vertex_group
        copy.mute = block.mute
        made[block.name] = copy
        _drive(copy, keys, block)
    for block in keys.key_blocks[1:]:
        made[block.name].relative_key = made[block.relative_key.name]


def _drive(copy: Any, keys: Any, block: Any) -> None:
    """The copied shape key's value is that of the source's, whatever animates that."""
    driver = copy.driver_add("value").driver
    driver.type = "AVERAGE"
    variable = driver.variables.new()
    variable.type = "SINGLE_PROP"
    variable.targets[0].id_type = "KEY"
    variable.targets[0].id = keys
    variable.targets[0].data_path = block.path_from_id("value")


def _copy_modifiers(thing: Any, source: Any) -> None:
    if source.parent_type == VIRTUAL_ARMATURE and source.parent is not None:
        modifier = add_first(thing, source.parent.name, "ARMATURE")
        modifier.object = source.parent
    for original in source.modifiers:
        if original.type not in COPIED:
            continue
        modifier = add_first(thing, original.name, original.type)
        for prop in original.bl_rna.properties:
            if not prop.is_readonly and prop.identifier not in ("name", "is_active"):
                setattr(modifier, prop.identifier, getattr(original, prop.identifier))


def _positions(points: Any) -> Float64:
    return read(points, "co", np.float32, 3).reshape(-1, 3).astype(np.float64)
