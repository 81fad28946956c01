# SPDX-License-Identifier: GPL-3.0-or-later
"""What overlays show of light meshes and tagged surfaces, as coloured triangles and lines in world space."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bmesh
import numpy as np
import numpy.typing as npt

from ...core.display_colors import hdr_colors, heat_colors, tag_colors
from ...core.errors import InvalidInput
from ...core.grid_samples import Cells
from ...core.mesh_topology import unit_normals
from ...core.overlay_lines import box_lines, half_ball_lines, normal_lines, outlines
from ...core.scene import UNTAGGED, Float32, Float64, Int32
from ..drawing.draw_surfaces import surface_under
from ..extraction.color_space import convert, working_to_rec709
from ..extraction.mesh_arrays import face_attribute, flipped, read
from ..findings import marked_faces
from ..light_faces import chosen_faces, read_faces
from ..light_geometry import LightFaces, light_faces_in_world
from ..names import (
    COLOR_ATTRIBUTE,
    EMISSION_ATTRIBUTE,
    TAG_ATTRIBUTE,
    TAG_PROPERTY,
    is_light_mesh,
)
from ..stored_values import factors, whole_number

NONE, COLOR, EMISSION, TAGS = "NONE", "COLOR", "EMISSION", "TAGS"
UNTAGGED_COLOR = (0.35, 0.35, 0.35)
LINE_COLOR, NORMAL_COLOR = (0.05, 0.05, 0.05, 0.8), (1.0, 0.85, 0.2, 1.0)
HALF_BALL_COLOR = (0.2, 0.7, 1.0, 0.6)
FINDING_COLOR = (1.0, 0.1, 0.1, 1.0)
BOX_SHARE = 0.85
"""Of a cell's edges that its box has, so that neighbours' do not cover each other."""
MOST_HALF_BALLS = 200
"""More cannot be told apart."""
MOST_SOUNDED = 500
"""Triangles of which corners are asked for how deep they lie, too: each takes some microseconds."""
REACH_SHARE = 0.5
"""Of a light's size within which its surface is looked for."""
DRAWN_IN = 0.9


@dataclass(frozen=True)
class Shape:
    """positions: (n, 3) float32 m, three for each triangle or two for each line. colors: (n, 4) float32 sRGB.

    nearer: (n,) float32 m, how far it has to come towards the eye to be seen before what it stands for.
    """

    is_lines: bool
    positions: Float32
    colors: Float32
    nearer: Float32


def triangles(corners: Float64, colors: npt.ArrayLike, alpha: float, nearer: npt.ArrayLike = 0.0) -> Shape:
    """corners: (t, 3, 3). colors: (t, 3) sRGB. nearer: (t,) m, or one for all."""
    rgba = np.full((len(corners), 4), alpha, np.float32)
    rgba[:, :3] = colors
    places = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
    metres = np.broadcast_to(np.asarray(nearer, np.float32), (len(corners),))
    return Shape(False, places, np.repeat(rgba, 3, axis=0), np.repeat(metres, 3))


def lines(ends: Float64, colors: npt.ArrayLike, nearer: float = 0.0) -> Shape:
    """ends: (l, 2, 3). colors: (4,) of all, or (l, 4). nearer: m."""
    rgba = np.broadcast_to(np.asarray(colors, np.float32), (len(ends), 4))
    places = np.ascontiguousarray(ends.reshape(-1, 3), np.float32)
    return Shape(True, places, np.repeat(rgba, 2, axis=0), np.full(len(places), nearer, np.float32))


def depths_below(scene: Any, depsgraph: Any, faces: LightFaces) -> Float64:
    """(t,) m: how deep each triangle lies below the visible surface that it stands for, or above it; 0 without one.

    Measured along its normal where its surface is farthest: in the middle over bulges, at the corners over hollows.
    """
    corners = faces.corners
    middles = corners.mean(axis=1)
    places = [middles] if len(corners) > MOST_SOUNDED else [middles, *np.moveaxis(_drawn_in(corners, middles), 1, 0)]
    reach = REACH_SHARE * np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1, initial=0.0)
    normals = unit_normals(corners)
    found = np.zeros(len(corners))
    for row in np.flatnonzero(reach > 0.0):
        for place in places:
            found[row] = max(found[row], _depth(scene, depsgraph, place[row], normals[row], float(reach[row])))
    return found


def _drawn_in(corners: Float64, middles: Float64) -> Float64:
    """Corners a little inside of their triangle: rays from its rim may pass its surface by."""
    return middles[:, None] + DRAWN_IN * (corners - middles[:, None])


def _depth(scene: Any, depsgraph: Any, place: Float64, normal: Float64, reach: float) -> float:
    """m from a point of a light to its surface; that of a light that is inside out faces the other way."""
    for sign in (1.0, -1.0):
        hit = surface_under(scene, depsgraph, place, normal, reach, sign)
        if hit is not None:
            return float(abs((hit.location - place) @ normal))
    return 0.0


def world_faces(thing: Any, depsgraph: Any) -> LightFaces:
    """`light_faces_in_world`, in edit mode without touching the mesh: drawing must not change what it draws."""
    if thing.mode != "EDIT":
        return light_faces_in_world(thing, depsgraph)
    edited = bmesh.from_edit_mesh(thing.data)
    matrix = np.array(thing.matrix_world, np.float64)
    places = np.array([vertex.co for vertex in edited.verts], np.float64).reshape(-1, 3)
    places = places @ matrix[:3, :3].T + matrix[:3, 3]
    edited.verts.index_update()
    edited.faces.index_update()
    loops = edited.calc_loop_triangles()
    rows = np.array([[loop.vert.index for loop in each] for each in loops], np.int32).reshape(-1, 3)
    faces = np.array([each[0].face.index for each in loops], np.int32)
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        rows = flipped(rows)
    return LightFaces(places[rows], faces, len(edited.faces))


def fill_shape(thing: Any, faces: LightFaces, fill: str, alpha: float, nearer: npt.ArrayLike = 0.0) -> Shape:
    """The lights of one light mesh in their colours, in what they send out by themselves, or in those of their tags.

    nearer: (t,) m; see `depths_below`.
    """
    if fill == TAGS:
        tags = read_faces(thing, TAG_ATTRIBUTE)
        colors = np.where((tags != UNTAGGED)[:, None], tag_colors(tags), UNTAGGED_COLOR)
    else:
        stored = read_faces(thing, EMISSION_ATTRIBUTE if fill == EMISSION else COLOR_ATTRIBUTE)[:, :3]
        factor, hue = factors(thing)
        colors = hdr_colors(factor * convert(stored * hue, working_to_rec709()))
    return triangles(faces.corners, colors[faces.faces], alpha, nearer)


def side_shapes(faces: LightFaces, nearer: float = 0.0) -> list[Shape]:
    """Outlines of the faces and a line towards the side that shines. nearer: m."""
    normals, areas = _normals(faces)
    return [
        lines(outlines(faces.corners, faces.faces), LINE_COLOR, nearer),
        lines(normal_lines(faces.middles, normals, areas), NORMAL_COLOR, nearer),
    ]


def half_ball_shape(thing: Any, faces: LightFaces, reach: float) -> Shape:
    """Where the chosen lights of one light mesh reach, of triangles as the grid has them, the first of many.

    reach: in distances of a light's farthest corner from its centroid.
    """
    corners = faces.corners[chosen_faces(thing)[faces.faces]][:MOST_HALF_BALLS]
    centres = corners.mean(axis=1)
    radii = reach * np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1, initial=0.0)
    return lines(half_ball_lines(centres, unit_normals(corners), radii), HALF_BALL_COLOR)


def finding_shapes(scene: Any, thing: Any, faces: LightFaces, alpha: float, nearer: npt.ArrayLike = 0.0) -> list[Shape]:
    """The faces of one light mesh that the last check named. nearer: (t,) m."""
    marked = np.zeros(faces.count, bool)
    for item in scene.vlm.findings:
        try:
            rows = marked_faces(scene, item).get(thing.name)
        except InvalidInput:
            continue  # what was checked is not there any more: nothing to mark
        if rows is not None:
            marked[rows] = True
    chosen = marked[faces.faces]
    corners, metres = faces.corners[chosen], np.broadcast_to(np.asarray(nearer), (len(chosen),))[chosen]
    rims = outlines(corners, faces.faces[chosen])
    return [
        triangles(corners, np.tile(FINDING_COLOR[:3], (len(corners), 1)), alpha, metres),
        lines(rims, FINDING_COLOR, float(metres.max(initial=0.0))),
    ]


def tagged_surface_shapes(depsgraph: Any, alpha: float) -> Iterator[Shape]:
    """The visible faces that have a tag, in the colours of the tags."""
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type != "MESH" or is_light_mesh(thing) or not instance.show_self:
            continue
        own = whole_number(thing, TAG_PROPERTY)
        if own == UNTAGGED and instance.is_instance and instance.parent is not None:
            own = whole_number(instance.parent, TAG_PROPERTY)
        if own == UNTAGGED and TAG_ATTRIBUTE not in thing.data.attributes and thing.mode != "EDIT":
            continue
        corners, tags = _tagged_faces(thing, np.array(instance.matrix_world, np.float64), own)
        if len(corners):
            yield triangles(corners, tag_colors(tags), alpha)


def cell_shapes(cells: Cells, tolerance: float, is_slice: bool, axis: int, alpha: float) -> list[Shape]:
    """Cells of a light grid, by how many lights count in them, or by how their error bound stands to the tolerance.

    is_slice: as a layer across `axis`, else as boxes. Red stands for the fullest cell, or for the tolerance.
    """
    if cells.errors is None:
        shares = cells.counts / max(int(cells.counts.max(initial=0)), 1)
    else:
        shares = cells.errors / tolerance
    shown = cells.counts > 0
    colors, corners = heat_colors(shares)[shown], cells.corners[shown]
    if not is_slice:
        rgba = np.column_stack([np.repeat(colors[None], 12, axis=0).reshape(-1, 3), np.full(12 * len(colors), 0.7)])
        middles = corners.mean(axis=1, keepdims=True)
        return [lines(box_lines(middles + BOX_SHARE * (corners - middles)), rgba)]
    return [triangles(_layer(corners, axis), np.repeat(colors, 2, axis=0), alpha)]


def _layer(corners: Float64, axis: int) -> Float64:
    """(2 c, 3, 3): each box's middle rectangle across an axis as two triangles."""
    first, second = (other for other in range(3) if other != axis)
    rectangle = np.repeat(corners.mean(axis=1)[:, None], 4, axis=1)
    for corner, (u, v) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        rectangle[:, corner, first], rectangle[:, corner, second] = corners[:, u, first], corners[:, v, second]
    return np.stack([rectangle[:, [0, 1, 2]], rectangle[:, [0, 2, 3]]], axis=1).reshape(-1, 3, 3)


def _tagged_faces(thing: Any, matrix: Float64, own: int) -> tuple[Float64, Int32]:
    """(t, 3, 3) triangles and (t,) tags of the tagged faces of a visible object (evaluated)."""
    if thing.mode == "EDIT":
        original = thing.original
        faces = world_faces(original, None)
        stored = read_faces(original, TAG_ATTRIBUTE)
        tags = np.where(stored != UNTAGGED, stored, own)[faces.faces]
        return faces.corners[tags != UNTAGGED], tags[tags != UNTAGGED].astype(np.int32)
    mesh = thing.data
    mesh.calc_loop_triangles()
    faces_of = read(mesh.loop_triangles, "polygon_index", np.int32)
    found = face_attribute(mesh, TAG_ATTRIBUTE, "INT")
    tags = np.full(len(mesh.polygons), own) if found is None else np.where(found != UNTAGGED, found, own)
    kept = tags[faces_of] != UNTAGGED
    rows = read(mesh.loop_triangles, "vertices", np.int32, 3).reshape(-1, 3)[kept]
    places = read(mesh.vertices, "co", np.float32, 3).reshape(-1, 3).astype(np.float64)
    places = places @ matrix[:3, :3].T + matrix[:3, 3]
    return places[rows], tags[faces_of][kept].astype(np.int32)


def _normals(faces: LightFaces) -> tuple[Float64, Float64]:
    """(n, 3) unit normals and (n,) areas of faces; zeros for those without area."""
    a, b, c = np.moveaxis(faces.corners, 1, 0)
    vectors = 0.5 * np.cross(b - a, c - a)
    total = np.stack([np.bincount(faces.faces, weights=axis, minlength=faces.count) for axis in vectors.T], axis=1)
    areas = np.linalg.norm(total, axis=1)
    return total / np.where(areas > 0.0, areas, 1.0)[:, None], areas
