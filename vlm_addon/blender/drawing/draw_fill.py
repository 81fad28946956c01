# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected faces of visible meshes, copied as lights: the surface as modifiers show it, each face one light."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...core.counting import counted
from ...core.errors import InvalidInput
from ...core.mesh_topology import Rows
from ...core.placement import insets, intrusions, place_behind
from ...core.scene import UNTAGGED
from ...core.tag_pairs import given_by_hand
from ..extraction.color_space import working_to_rec709
from ..extraction.materials import FindingList, MaterialTable
from ..extraction.mesh_arrays import LocalMesh, place, read, read_mesh
from ..extraction.mesh_extraction import MeshExtractor
from ..light_meshes import is_local, light_meshes_of
from ..names import TAG_PROPERTY, is_light_mesh
from ..stored_values import whole_number
from .draw_lights import NewLights, find_target, light_count, require_target, write_lights
from .drawn_faces import Faces


def fill_sources(context: Any) -> list[Any]:
    """The visible meshes whose selected faces would be filled: those in edit mode, or else those selected."""
    things = context.objects_in_mode_unique_data if context.mode == "EDIT_MESH" else context.selected_objects
    found = [thing for thing in things if thing.type == "MESH" and not is_light_mesh(thing)]
    return sorted(found, key=lambda thing: thing.name)


def fill(context: Any, target: str = "") -> str:
    """Make lights of the selected faces of the visible meshes, set behind them; returns a sentence with counts.

    They go into the light mesh `target`; by default into the active one, or one that has lights of the same object, or
    a new one. Linked meshes are only read. Edit mode is left: its undo knows the edited meshes alone. Raises
    InvalidInput; nothing is changed then.
    """
    things = fill_sources(context)
    thing = find_target(context, target) or _light_mesh_of(things, context.scene)
    depsgraph = context.evaluated_depsgraph_get()
    parts = [part for part in (_lights_of(source, depsgraph) for source in things) if part is not None]
    if not parts:
        problem = "no face of the selected meshes is selected"
        raise InvalidInput("selection", problem, "select faces in edit mode (Tab, then 3)")
    made = _joined(parts)
    edited = context.mode == "EDIT_MESH"
    if edited:
        bpy.ops.object.mode_set(mode="OBJECT")
    written, added = write_lights(context, made, thing)
    if not added:
        if edited:
            bpy.ops.object.mode_set(mode="EDIT")
        raise InvalidInput("selection", "all of its faces have their light already", "select others")
    thin = (
        f"; {made.in_front} in front of their surface: thin or sharply curved, give both a tag" if made.in_front else ""
    )
    return f"Made {light_count(added)} of {counted(len(made.faces.corners), 'face')}, in {written.name}{thin}"


def _light_mesh_of(things: list[Any], scene: Any) -> Any | None:
    found = [each for thing in things for each in light_meshes_of(thing, scene) if is_local(each)]
    if not found:
        return None
    require_target(found[0])
    return found[0]


def _lights_of(thing: Any, depsgraph: Any) -> NewLights | None:
    """The selected faces of one object, None where there are none. Raises InvalidInput for a broken mesh."""
    evaluated = thing.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        return _read(thing, evaluated, mesh, depsgraph)
    finally:
        evaluated.to_mesh_clear()


def _read(thing: Any, evaluated: Any, mesh: Any, depsgraph: Any) -> NewLights | None:
    chosen = read(mesh.polygons, "select", bool) & ~read(mesh.polygons, "hide", bool)
    if not chosen.any():
        return None
    local = read_mesh(mesh, f"object {thing.name!r}")
    positions, triangles, _, mirrored = place(local, np.array(evaluated.matrix_world, np.float64))
    rows = chosen[local.faces]
    used, corners = np.unique(triangles[rows], return_inverse=True)
    lights = corners.reshape(-1, 3)
    source = positions[triangles[rows]]
    regions = Rows(np.arange(len(lights)), np.arange(len(lights) + 1))
    points = place_behind(positions[used], lights, regions, source).positions
    number = np.cumsum(chosen) - 1
    owners = number[local.faces[rows]]
    deep = intrusions(points[lights], regions, source) > 0.5 * insets(points[lights])
    reflectance, emission = _averages(evaluated, local, rows, depsgraph)
    areas = 0.5 * np.linalg.norm(np.cross(source[:, 1] - source[:, 0], source[:, 2] - source[:, 0]), axis=1)
    own = given_by_hand(whole_number(thing, TAG_PROPERTY))
    count = int(chosen.sum())
    tags = np.full(count, own, np.int32)
    face_tags = given_by_hand(local.face_tags[rows])
    tags[owners] = np.where(face_tags != UNTAGGED, face_tags, own)
    return NewLights(
        faces=Faces(points, _rings(mesh, chosen, used, mirrored)),
        colors=_face_means(reflectance, areas, owners, count),
        emission=_face_means(emission, areas, owners, count),
        tags=tags,
        names=(thing.name,),
        in_front=len(np.unique(owners[deep])),
    )


def _rings(mesh: Any, chosen: np.ndarray, used: np.ndarray, mirrored: bool) -> tuple[tuple[int, ...], ...]:
    """The chosen polygons by rows of `used`, the vertices of theirs in order."""
    vertices = np.searchsorted(used, read(mesh.loops, "vertex_index", np.int32))
    starts = read(mesh.polygons, "loop_start", np.int32)
    rings = [rest.tolist() for rest in np.split(vertices, starts[1:])]
    return tuple(tuple(ring[::-1] if mirrored else ring) for ring, one in zip(rings, chosen, strict=True) if one)


def _averages(evaluated: Any, local: LocalMesh, rows: np.ndarray, depsgraph: Any) -> tuple[np.ndarray, np.ndarray]:
    to_rec709, report = working_to_rec709(), FindingList()
    part = LocalMesh(
        positions=local.positions,
        triangles=local.triangles[rows],
        faces=local.faces[rows],
        corner_normals=local.corner_normals[rows],
        uv_maps={name: values[rows] for name, values in local.uv_maps.items()},
        active_uv_map=local.active_uv_map,
        corner_colors={name: values[rows] for name, values in local.corner_colors.items()},
        material_slots=local.material_slots[rows],
        face_tags=local.face_tags[rows],
    )
    extractor = MeshExtractor(MaterialTable(to_rec709, report), to_rec709, report, depsgraph)
    return extractor.averages(evaluated, part)


def _face_means(values: np.ndarray, areas: np.ndarray, owners: np.ndarray, count: int) -> np.ndarray:
    weights = np.bincount(owners, areas, count)
    sums = np.stack([np.bincount(owners, values[:, channel] * areas, count) for channel in range(3)], axis=1)
    return np.asarray(sums / np.where(weights > 0.0, weights, 1.0)[:, None], np.float32)


def _joined(parts: list[NewLights]) -> NewLights:
    starts = np.cumsum([0] + [len(part.faces.points) for part in parts])
    corners = [
        tuple(corner + int(start) for corner in ring)
        for part, start in zip(parts, starts[:-1], strict=True)
        for ring in part.faces.corners
    ]
    return NewLights(
        faces=Faces(np.concatenate([part.faces.points for part in parts]), tuple(corners)),
        colors=np.concatenate([part.colors for part in parts]),
        emission=np.concatenate([part.emission for part in parts]),
        tags=np.concatenate([part.tags for part in parts]),
        names=tuple(name for part in parts for name in part.names),
        in_front=sum(part.in_front for part in parts),
    )
