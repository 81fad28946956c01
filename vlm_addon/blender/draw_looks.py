# SPDX-License-Identifier: GPL-3.0-or-later
"""What the visible surface under pieces of drawn lights reflects and emits, and which tag it carries.

A piece takes its texture coordinates from the triangle under its middle, continued over the piece, so that textures
are averaged over just what the piece covers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..core.scene import UNTAGGED, Float32, Float64
from .color_space import working_to_rec709
from .draw_surfaces import SurfaceHit
from .materials import FindingList, MaterialTable
from .mesh_arrays import LocalMesh, read_attribute
from .mesh_extraction import MeshExtractor
from .names import TAG_ATTRIBUTE, TAG_PROPERTY

ON_TRIANGLE = 1e-3
"""How far off a triangle, as a share of its size, a hit may lie that was reported on it."""


@dataclass(frozen=True)
class Looks:
    """One row per piece. reflectance, emission (W/m²): (p, 3) float32, linear Rec.709. tags: (p,) int32."""

    reflectance: Float32
    emission: Float32
    tags: np.ndarray


@dataclass(frozen=True)
class _Under:
    """The triangle under a piece: corners of its mesh (3,), weights of them at the piece's corners (3, 3)."""

    thing: Any
    mesh: Any
    vertices: list[int]
    loops: list[int]
    weights: Float64
    face: int
    owner: Any


def looks_under(pieces: Float64, hits: Sequence[SurfaceHit | None], depsgraph: Any) -> Looks:
    """The looks of the surface under each piece; zero where nothing was hit, or what was hit cannot be read.

    pieces: (p, 3, 3) float64 world. hits: the surface under the middle of each.
    """
    reader = _Reader(depsgraph)
    reflectance, emission = np.zeros((2, len(pieces), 3), np.float32)
    tags = np.full(len(pieces), UNTAGGED, np.int32)
    try:
        by_object: dict[int, list[tuple[int, _Under]]] = {}
        for row, hit in enumerate(hits):
            under = None if hit is None else reader.triangle(hit, pieces[row])
            if under is not None:
                tags[row] = reader.tag(under)
                by_object.setdefault(id(under.mesh), []).append((row, under))
        for found in by_object.values():
            rows = [row for row, _ in found]
            reflectance[rows], emission[rows] = reader.averages([under for _, under in found])
    finally:
        reader.close()
    return Looks(reflectance, emission, tags)


class _Reader:
    """Reads single triangles of evaluated meshes; `close` gives temporary meshes back."""

    def __init__(self, depsgraph: Any) -> None:
        self._depsgraph = depsgraph
        to_rec709 = working_to_rec709()
        report = FindingList()
        self._extractor = MeshExtractor(MaterialTable(to_rec709, report), to_rec709, report, depsgraph)
        self._meshes: dict[tuple[str, str | None], tuple[Any, Any]] = {}
        self._temporary: list[Any] = []

    def close(self) -> None:
        for thing in self._temporary:
            thing.to_mesh_clear()

    def triangle(self, hit: SurfaceHit, piece: Float64) -> _Under | None:
        """The triangle that was hit. Blender names the owner of instances that geometry nodes make, not what is
        instanced: then the instance in that place is looked for."""
        original = bpy.data.objects.get(hit.key)
        if original is None:
            return None
        if hit.key not in self._meshes:
            self._meshes[hit.key] = self._own_mesh(original)
        thing, mesh = self._meshes[hit.key]
        found = _under(thing, mesh, original, hit, piece)
        if found is not None:
            return found
        for thing, mesh in self._instanced(original, hit):
            found = _under(thing, mesh, original, hit, piece)
            if found is not None:
                return found
        return None

    def _own_mesh(self, original: Any) -> tuple[Any, Any]:
        thing = original.evaluated_get(self._depsgraph)
        if thing.type == "MESH" and original.mode != "EDIT":
            mesh = thing.data
        else:
            mesh = thing.to_mesh()
            self._temporary.append(thing)
        if mesh is not None:
            mesh.calc_loop_triangles()
        return thing, mesh

    def _instanced(self, original: Any, hit: SurfaceHit) -> Iterator[tuple[Any, Any]]:
        for instance in self._depsgraph.object_instances:
            parent = instance.parent
            if not instance.is_instance or parent is None or parent.original != original:
                continue
            if instance.object.type == "MESH" and np.allclose(np.array(instance.matrix_world), hit.matrix, atol=1e-5):
                mesh = instance.object.data
                mesh.calc_loop_triangles()
                yield instance.object, mesh

    def tag(self, under: _Under) -> int:
        """Tag of the face where it has one, else of the object."""
        attribute = under.mesh.attributes.get(TAG_ATTRIBUTE)
        if attribute is not None and attribute.domain == "FACE" and attribute.data_type == "INT":
            value = int(attribute.data[under.face].value)
            if value != UNTAGGED:
                return value
        return int(under.owner.get(TAG_PROPERTY, UNTAGGED))

    def averages(self, found: list[_Under]) -> tuple[Float32, Float32]:
        """Reflectance and emission of pieces over one mesh."""
        thing, mesh = found[0].thing, found[0].mesh
        count = len(found)
        local = LocalMesh(
            positions=np.zeros((0, 3), np.float32),
            triangles=np.array([under.vertices for under in found], np.int32),
            faces=np.arange(count, dtype=np.int32),
            corner_normals=np.zeros((count, 3, 3), np.float32),
            uv_maps={layer.name: _continued(found, [_uv(layer, under) for under in found]) for layer in mesh.uv_layers},
            active_uv_map=next((layer.name for layer in mesh.uv_layers if layer.active_render), ""),
            corner_colors={each.name: np.maximum(_colors(each, found), 0.0) for each in mesh.color_attributes},
            material_slots=np.array([mesh.polygons[under.face].material_index for under in found], np.int32),
            face_tags=np.zeros(count, np.int32),
        )
        return self._extractor.averages(thing, local)


def _under(thing: Any, mesh: Any, owner: Any, hit: SurfaceHit, piece: Float64) -> _Under | None:
    """The triangle of face `hit.face` that holds the hit, or None where the face is elsewhere."""
    if mesh is None or hit.face >= len(mesh.polygons):
        return None
    polygon = mesh.polygons[hit.face]
    # Triangles follow each other in order of faces, two fewer than each face has corners.
    first = polygon.loop_start - 2 * hit.face
    best, least = None, ON_TRIANGLE
    for number in range(first, first + polygon.loop_total - 2):
        triangle = mesh.loop_triangles[number]
        vertices, loops = list(triangle.vertices), list(triangle.loops)
        corners = np.array([mesh.vertices[vertex].co for vertex in vertices], np.float64)
        corners = corners @ hit.matrix[:3, :3].T + hit.matrix[:3, 3]
        weights, off = _weights(corners, hit.location[None])
        outside = max(-float(weights.min()), off)
        if outside < least:
            best = _Under(thing, mesh, vertices, loops, _weights(corners, piece)[0], hit.face, owner)
            least = outside
    return best


def _weights(corners: Float64, points: Float64) -> tuple[Float64, float]:
    """(p, 3) barycentric weights of points projected onto a triangle's plane, and how far the first lies off it as a
    share of the triangle's size."""
    along, across = corners[1] - corners[0], corners[2] - corners[0]
    normal = np.cross(along, across)
    squared = float(normal @ normal)
    if squared == 0.0:
        return np.full((len(points), 3), -np.inf), np.inf
    offsets = points - corners[0]
    second = np.cross(offsets, across) @ normal / squared
    third = np.cross(along, offsets) @ normal / squared
    off = abs(float(offsets[0] @ normal)) / squared**0.75
    return np.column_stack([1.0 - second - third, second, third]), off


def _continued(found: list[_Under], corners: list[Float64]) -> Float32:
    """(t, 3, c) values at the pieces' corners of values at the triangles' corners."""
    values = [under.weights @ each for under, each in zip(found, corners, strict=True)]
    return np.array(values, np.float32)


def _uv(layer: Any, under: _Under) -> Float64:
    return np.array([layer.uv[loop].vector for loop in under.loops], np.float64)


def _colors(attribute: Any, found: list[_Under]) -> Float32:
    values = read_attribute(attribute)[:, :3]
    corners = [values[under.vertices if attribute.domain == "POINT" else under.loops] for under in found]
    return _continued(found, [each.astype(np.float64) for each in corners])
