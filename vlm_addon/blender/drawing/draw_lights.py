# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons on visible surfaces become lights of a light mesh, in object mode and in edit mode alike.

All is worked out before anything is written: colours, emission and tags from the surface under each polygon, and how
far it goes behind that surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.counting import counted
from ...core.errors import InvalidInput
from ...core.light_mesh import empty_light_mesh
from ...core.scene import Float32, Float64
from ..extraction.color_space import convert, rec709_to_working
from ..extraction.materials import DEFAULT_COLOR
from ..light_faces import DEFAULTS, face_count, read_faces, select_faces, write_faces
from ..light_meshes import add_sources, require_editable
from ..names import (
    AREA_SCALE_ATTRIBUTE,
    COLOR_ATTRIBUTE,
    EMISSION_ATTRIBUTE,
    LOCK_ATTRIBUTE,
    MARK_ATTRIBUTE,
    TAG_ATTRIBUTE,
    is_light_mesh,
)
from ..write_back import write_light_mesh
from .draw_looks import looks_under
from .draw_mesh import edited, vertices_world
from .draw_placement import Pieces, Placed, behind_surface, pieces_of
from .draw_points import require_distance
from .drawn_faces import Faces, faces_of

NAME = "VLM Drawn"

WELD_SHARE = 1e-5
"""A point within this share of its face's size of a vertex of the light mesh is that vertex."""


@dataclass(frozen=True)
class NewLights:
    """Lights as they will be written. Rows per face: colors, emission (linear Rec.709) and tags; names: objects they
    lie on; without_surface, from_behind, in_front: how many have no surface, lie on its back, could not get behind it.
    """

    faces: Faces
    colors: Float32
    emission: Float32
    tags: np.ndarray
    names: tuple[str, ...] = ()
    without_surface: int = 0
    from_behind: int = 0
    in_front: int = 0


def draw(
    context: Any, points: Float64, corners: Sequence[Sequence[int]], normals: Float64, offset: float, target: str = ""
) -> str:
    """Make polygons lights of a light mesh; returns a sentence with counts.

    points: (v, 3) float64 world, on the visible surface. corners: indices into points of each polygon. normals: (f, 3)
    the side that each lights; zero: that from which its corners run anticlockwise. offset: m behind the surface, beyond
    what is needed. target: name of the light mesh, by default the active one, or else a new one. Points at vertices of
    the light mesh become these vertices. Raises InvalidInput; nothing is changed then.
    """
    require_distance(offset, "offset")
    thing = find_target(context, target)
    if context.mode == "EDIT_MESH" and (thing is None or thing.mode != "EDIT"):
        # Its undo would leave them.
        raise InvalidInput("light mesh", "it is not the one in edit mode", "leave edit mode, or name the one in it")
    faces = faces_of(points, corners, normals)
    made = worked_out(context, faces, offset, thing)
    written, added = write_lights(context, made, thing)
    if not added:
        raise InvalidInput("polygon", "there is a light between the same vertices", "erase it first")
    return _sentence(made, written, added)


def find_target(context: Any, name: str) -> Any | None:
    """The light mesh that takes what is drawn; None for a new one. Raises InvalidInput where it cannot."""
    if name:
        thing = context.scene.objects.get(name)
        if thing is None or not is_light_mesh(thing) or thing.type != "MESH":
            remedy = "name one of the scene's light meshes, or none for a new one"
            raise InvalidInput(f"object {name!r}", "it is no light mesh of this scene", remedy)
    else:
        active = context.active_object
        thing = active if active is not None and active.type == "MESH" and is_light_mesh(active) else None
    if thing is not None:
        require_target(thing)
    return thing


def require_target(thing: Any) -> None:
    """Raises InvalidInput for a light mesh that cannot take lights."""
    require_editable(thing)
    if abs(np.linalg.det(np.array(thing.matrix_world))) == 0.0:
        raise InvalidInput(f"light mesh {thing.name!r}", "its scale is zero", "give it a scale")


def worked_out(context: Any, faces: Faces, offset: float, thing: Any | None) -> NewLights:
    """Where the faces go and what they look like; reads the scene only."""
    scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
    pieces, sign = pieces_of(faces, scene, depsgraph), 1.0
    if not any(pieces.hits):
        behind = pieces_of(faces, scene, depsgraph, -1.0)
        pieces, sign = (behind, -1.0) if any(behind.hits) else (pieces, 1.0)
    shared = _shared_points(faces, thing)
    placed = behind_surface(faces, pieces, shared, scene, depsgraph, offset)
    if placed.in_front.any() and shared.any():
        # Shared vertices hold it in front: better a gap between two lights than light in front of its surface.
        placed = behind_surface(faces, pieces, np.zeros(len(shared), bool), scene, depsgraph, offset)
    return _looked_at(faces, placed, pieces, depsgraph, sign)


def _looked_at(faces: Faces, placed: Placed, pieces: Pieces, depsgraph: Any, sign: float) -> NewLights:
    looks = looks_under(pieces.corners, pieces.hits, depsgraph)
    count = len(faces.corners)
    hit = np.array([each is not None for each in pieces.hits], bool)
    weights = np.bincount(pieces.faces, pieces.areas * hit, count).astype(np.float64)
    found = weights > 0.0
    colors = np.where(found[:, None], _means(looks.reflectance, pieces, hit, weights), DEFAULT_COLOR)
    names = [each.key[0] for each in pieces.hits if each is not None]
    return NewLights(
        faces=Faces(placed.points, faces.corners),
        colors=colors.astype(np.float32),
        emission=_means(looks.emission, pieces, hit, weights).astype(np.float32),
        tags=_commonest_tags(looks.tags, pieces, hit, count),
        names=tuple(dict.fromkeys(names)),
        without_surface=int((~found).sum()),
        from_behind=int(found.sum()) if sign < 0.0 else 0,
        in_front=int(placed.in_front.sum()),
    )


def _means(values: Float32, pieces: Pieces, hit: np.ndarray, weights: Float64) -> Float64:
    sums = [np.bincount(pieces.faces, values[:, channel] * pieces.areas * hit, len(weights)) for channel in range(3)]
    return np.stack(sums, axis=1) / np.where(weights > 0.0, weights, 1.0)[:, None]


def _commonest_tags(tags: np.ndarray, pieces: Pieces, hit: np.ndarray, count: int) -> np.ndarray:
    """(f,) int32: of each face the tag that covers the largest part of it, the smaller id where two do."""
    result = np.zeros(count, np.int32)
    largest = np.zeros(count)
    for tag in np.unique(tags[hit]):
        area = np.bincount(pieces.faces, pieces.areas * (hit & (tags == tag)), count)
        result[area > largest] = tag
        largest = np.maximum(largest, area)
    return result


def write_lights(context: Any, made: NewLights, thing: Any | None) -> tuple[Any, int]:
    """The light mesh that now has the new lights, and how many these are; a new one where `thing` is None.

    They are selected, for what comes next. Faces that are there already are left out.
    """
    if thing is None:
        thing = _new_light_mesh(context, made.faces.points)
    before = face_count(thing)
    added = _add_faces(thing, made.faces)
    matrix = rec709_to_working()
    for name, values in (
        (COLOR_ATTRIBUTE, convert(made.colors, matrix)),
        (EMISSION_ATTRIBUTE, convert(made.emission, matrix)),
    ):
        rows = read_faces(thing, name)
        rows[before:, :3], rows[before:, 3] = values[added], 1.0
        write_faces(thing, name, rows)
    tags = read_faces(thing, TAG_ATTRIBUTE)
    tags[before:] = made.tags[added]
    write_faces(thing, TAG_ATTRIBUTE, tags)
    _reset(thing, before)
    select_faces(thing, np.arange(face_count(thing)) >= before)
    if thing.mode != "EDIT":
        # Undo in edit mode knows the mesh alone.
        add_sources(thing, made.names, context.scene)
    return thing, len(added)


def _reset(thing: Any, before: int) -> None:
    """The values that new lights do not take from the surface are as in a light mesh without that attribute."""
    for name in (AREA_SCALE_ATTRIBUTE, LOCK_ATTRIBUTE, MARK_ATTRIBUTE):
        rows = read_faces(thing, name)
        rows[before:] = DEFAULTS[name][0]
        write_faces(thing, name, rows)


def _new_light_mesh(context: Any, points: Float64) -> Any:
    """An empty light mesh with its origin amid `points`; the active object where this mode allows it."""
    name, number = NAME, 0
    while name in bpy.data.objects:
        number += 1
        name = f"{NAME}.{number:03}"
    thing = write_light_mesh(empty_light_mesh(), name, (), context.scene)
    thing.matrix_world = Matrix.Translation(0.5 * (points.min(axis=0) + points.max(axis=0)))
    if context.mode == "OBJECT" and thing.name in context.view_layer.objects:
        for other in context.selected_objects:
            other.select_set(False)
        thing.select_set(True)
        context.view_layer.objects.active = thing
    return thing


def _nearest_vertices(points: Float64, faces: Faces, thing: Any | None) -> np.ndarray:
    """(v,) int64: the vertex of the light mesh that is at each point, -1 where there is none."""
    nearest = np.full(len(points), -1)
    vertices = np.zeros((0, 3)) if thing is None else vertices_world(thing)
    if not len(vertices):
        return nearest
    for ring in faces.corners:
        rows = list(ring)
        weld = WELD_SHARE * float(np.ptp(points[rows], axis=0).max())
        for row in rows:
            squared = ((vertices - points[row]) ** 2).sum(axis=1)
            best = int(np.argmin(squared))
            if squared[best] <= weld**2:
                nearest[row] = best
    return nearest


def _shared_points(faces: Faces, thing: Any | None) -> np.ndarray:
    shared: np.ndarray = _nearest_vertices(faces.points, faces, thing) >= 0
    return shared


def _add_faces(thing: Any, faces: Faces) -> list[int]:
    """New faces at the end of the mesh; returns the numbers of those that were not there before."""
    matrix = np.array(thing.matrix_world, np.float64)
    inverse = np.linalg.inv(matrix)
    local = faces.points @ inverse[:3, :3].T + inverse[:3, 3]
    mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
    existing = _nearest_vertices(faces.points, faces, thing)
    added = []
    with edited(thing) as mesh:
        mesh.verts.ensure_lookup_table()
        old = list(mesh.verts)
        vertices = {}
        for row in sorted({corner for ring in faces.corners for corner in ring}):
            vertices[row] = old[existing[row]] if existing[row] >= 0 else mesh.verts.new(Vector(local[row]))
        for number, ring in enumerate(faces.corners):
            corners = [vertices[corner] for corner in (ring[::-1] if mirrored else ring)]
            if len(set(corners)) == len(corners) and mesh.faces.get(corners) is None:
                mesh.faces.new(corners).normal_update()
                added.append(number)
        for vertex in vertices.values():
            if not vertex.link_faces:
                mesh.verts.remove(vertex)
        mesh.verts.index_update()
        mesh.faces.index_update()
    return added


def light_count(count: int) -> str:
    """A number of lights in words."""
    return counted(count, "light")


def _sentence(made: NewLights, thing: Any, count: int) -> str:
    parts = [f"Drew {light_count(count)} into {thing.name}"]
    if made.without_surface:
        parts.append(f"{made.without_surface} without a surface under them, gray")
    if made.from_behind:
        parts.append("on the back of the surface, which sends out no light: turn its normals (Mesh > Normals > Flip)")
    if made.in_front:
        parts.append(
            f"{made.in_front} still in front of their surface (thin, or a step in it): draw smaller, or tag both"
        )
    return "; ".join(parts)
