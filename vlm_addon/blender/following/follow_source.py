# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes that move with what they stand for: parent, armature weights and shape keys from the nearest surface.

The light mesh, as it stands at the frame that is shown, takes over its source's space and rig; its shape at rest is
found so that at this frame nothing moves. Where the rig cannot be copied (a simulation, geometry nodes) it is bound to
the source's evaluated surface by Blender's Surface Deform.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...core.errors import InvalidInput
from ...core.scene import Float64
from ..extraction.dynamics import is_dynamic
from ..extraction.mesh_arrays import read
from ..extraction.temporary import restored
from ..light_meshes import keep_places, require_editable, set_sources, sources
from ..names import DYNAMIC_PROPERTY
from ..stored_values import set_value
from .follow_rig import PREFIX, add_first, copy_rig, is_following, mark, remove_rig, rig_problem
from .rest_shape import evaluated_shape, find_rest, set_shape, shape
from .separate_lights import has_lights_of, separate_by_source
from .surface_transfer import Surface, evaluated_surface, nearest, to_world, vertex_normals

AUTO, RIG, SURFACE = "AUTO", "RIG", "SURFACE"
WAYS = (
    (AUTO, "Automatic", "The rig where it can be copied, the surface otherwise"),
    (RIG, "Rig", "Copy vertex groups, shape keys and armature modifiers of the source"),
    (SURFACE, "Surface", "Bind to the source's evaluated surface: for simulations and geometry nodes"),
)


@dataclass(frozen=True)
class Following:
    """One light mesh that now follows. way: RIG or SURFACE. off: how far the farthest vertex is off where it was, m.
    distance: mean distance of its vertices to the source, m. note: what was not possible, "" for nothing."""

    light_mesh: str
    source: str
    way: str
    vertices: int
    off: float
    distance: float
    note: str


def follow_sources(thing: Any, context: Any, chosen: Sequence[Any] = (), way: str = AUTO) -> list[Following]:
    """Let a light mesh follow its sources, or the objects `chosen`; one entry for each light mesh that follows.

    Of several sources each one that moves gets a light mesh of its own; the lights of the others stay where they are.
    What followed before is freed first. Raises InvalidInput where there is nothing to follow; then nothing is changed.
    """
    require_followable(thing, context, chosen)
    found, moving = _followed(thing, context, chosen)
    stop_following(thing, context)
    if chosen:
        set_sources(thing, [source.name for source in found], context.scene)
    _own_mesh(thing)
    parts = [(thing, found[0])] if len(found) == 1 else separate_by_source(thing, found, moving, context)
    return [_bind(part, source, context, way) for part, source in parts]


def _followed(thing: Any, context: Any, chosen: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """The sources of a light mesh, and those that it will follow: the moving ones, or the only one in any case."""
    found = list(chosen) or [source for source in sources(thing, context.scene) if source is not None]
    return found, found if len(found) == 1 else [source for source in found if is_dynamic(source)]


def require_followable(thing: Any, context: Any, chosen: Sequence[Any] = ()) -> None:
    """Raises InvalidInput where a light mesh cannot follow its sources, or the objects `chosen`."""
    require_editable(thing)
    found, moving = _followed(thing, context, chosen)
    subject = f"light mesh {thing.name!r}"
    if not found:
        remedy = "select the object that it should follow, too"
        raise InvalidInput(subject, "nothing is known of what it was made from", remedy)
    if not moving:
        remedy = "animate one, or select the light mesh and the one object that it should follow"
        raise InvalidInput(subject, f"none of its {len(found)} sources moves", remedy)
    if not thing.visible_get() or not len(thing.data.vertices):
        raise InvalidInput(subject, "it is hidden or empty", "show it in the viewport")
    depsgraph = context.evaluated_depsgraph_get()
    for source in moving:
        if not len(evaluated_surface([source], depsgraph).triangles):
            problem = "it shows no surface in the viewport"
            raise InvalidInput(f"source {source.name!r}", problem, "show it while the light mesh is bound to it")
        if abs(np.linalg.det(np.array(source.matrix_world)[:3, :3])) == 0.0:
            raise InvalidInput(f"source {source.name!r}", "its scale is zero", "give it a scale at this frame")
        if thing in _ancestors(source):
            raise InvalidInput(f"source {source.name!r}", f"it follows {thing.name!r} itself", "clear its parent")
    if len(found) > 1 and not has_lights_of(thing, found, moving, context):
        problem = f"none of its lights stands for {moving[0].name!r}, which moves"
        raise InvalidInput(subject, problem, "create it again with more lights, or from that object alone")


def stop_following(thing: Any, context: Any) -> bool:
    """Free a light mesh from what it follows; it keeps the shape and place of this frame. False where it was free."""
    require_editable(thing)
    if not is_following(thing):
        return False
    with _without_other_modifiers(thing):
        positions = evaluated_shape(thing, context)
    _own_mesh(thing)
    remove_rig(thing)
    set_shape(thing, positions)
    _move_to(thing, None, np.array(thing.matrix_world, np.float64))
    set_value(thing, DYNAMIC_PROPERTY, is_dynamic(thing))
    keep_places(thing, context.scene)
    return True


def _bind(thing: Any, source: Any, context: Any, way: str) -> Following:
    """Parent, rig or surface binding of one light mesh to one source."""
    depsgraph = context.evaluated_depsgraph_get()
    problem = rig_problem(source, depsgraph)
    surface = evaluated_surface([source], depsgraph)
    matrix = np.array(thing.matrix_world, np.float64)
    wanted = to_world(shape(thing), matrix)
    near = nearest(surface, wanted, _normals(thing, wanted, matrix))
    local_matrix = np.array(source.matrix_world, np.float64)
    local = to_world(wanted, np.linalg.inv(local_matrix))
    set_shape(thing, local)
    _move_to(thing, source, local_matrix)
    mark(thing)
    note = ""
    by_surface = source.type == "MESH" and (way == SURFACE or (way == AUTO and problem is not None))
    if by_surface:
        note = _bind_to_surface(thing, source)
    elif problem is not None:
        note = problem
    if not by_surface or note:
        by_surface = False
        _copy_rig_of(thing, source, depsgraph, surface, near.triangles, near.weights)
    with _without_other_modifiers(thing):
        off = find_rest(thing, local, context)
    set_value(thing, DYNAMIC_PROPERTY, is_dynamic(thing))
    keep_places(thing, context.scene)
    mean = float(near.distances.mean())
    return Following(thing.name, source.name, SURFACE if by_surface else RIG, len(local), off, mean, note)


def _copy_rig_of(
    thing: Any, source: Any, depsgraph: Any, surface: Surface, triangles: np.ndarray, weights: Float64
) -> None:
    own = source.evaluated_get(depsgraph).data if source.type == "MESH" else None
    if own is not None and len(own.vertices) == len(surface.positions):
        keys = source.data.shape_keys
        if keys is None or len(own.vertices) == len(source.data.vertices):
            copy_rig(thing, source, depsgraph, surface.corners[triangles], weights)


def _bind_to_surface(thing: Any, source: Any) -> str:
    """Surface Deform from `source`; returns why Blender refuses, "" where it binds."""
    modifier = add_first(thing, source.name, "SURFACE_DEFORM")
    modifier.target = source
    reason = ""
    with bpy.context.temp_override(object=thing, active_object=thing, selected_objects=[thing]):
        try:
            bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
        except RuntimeError as error:
            reason = str(error).strip()
    if modifier.is_bound:
        return ""
    thing.modifiers.remove(modifier)
    return f"Surface Deform cannot bind to it ({reason or 'see its modifier for the reason'})"


def _move_to(thing: Any, parent: Any, matrix: Float64) -> None:
    """Parent and world matrix; lights go on facing as they did where one of the two spaces mirrors."""
    before = np.linalg.det(np.array(thing.matrix_world, np.float64)[:3, :3])
    if before * np.linalg.det(matrix[:3, :3]) < 0.0:
        thing.data.flip_normals()
    thing.parent = parent
    thing.parent_type = "OBJECT"
    thing.matrix_parent_inverse = Matrix.Identity(4)
    thing.matrix_basis = Matrix.Identity(4) if parent is not None else Matrix(matrix)
    bpy.context.view_layer.update()


def _own_mesh(thing: Any) -> None:
    """Other objects that share the mesh keep it as it is."""
    if thing.data.users > 1:
        thing.data = thing.data.copy()


def _without_other_modifiers(thing: Any) -> ExitStack:
    """For a while the artist's own modifiers are off."""
    stack = ExitStack()
    for modifier in thing.modifiers:
        if not modifier.name.startswith(PREFIX):
            stack.enter_context(restored(modifier, show_viewport=False))
    return stack


def _normals(thing: Any, positions: Float64, matrix: Float64) -> Float64:
    """(v, 3): where the lights around each vertex shine."""
    mesh = thing.data
    mesh.calc_loop_triangles()
    triangles = read(mesh.loop_triangles, "vertices", np.int32, 3).reshape(-1, 3)
    sign = -1.0 if np.linalg.det(matrix[:3, :3]) < 0.0 else 1.0
    return sign * vertex_normals(positions, triangles)


def _ancestors(thing: Any) -> list[Any]:
    found = []
    while thing.parent is not None:
        thing = thing.parent
        found.append(thing)
    return found
