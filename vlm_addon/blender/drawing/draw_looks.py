# SPDX-License-Identifier: GPL-3.0-or-later
"""What the visible surface under pieces of drawn lights reflects and emits, and which tag it carries.

A piece takes its texture coordinates from the triangle under its middle, continued over the piece, so that textures
are averaged over just what the piece covers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import bpy
import numpy as np

from ...core.scene import UNTAGGED, Float32, Float64
from ...core.tag_pairs import given_by_hand
from ..extraction.kept_materials import forget_large, material_reader
from ..extraction.mesh_arrays import LocalMesh, read_attribute
from ..names import TAG_ATTRIBUTE, TAG_PROPERTY
from ..stored_values import whole_number
from .draw_surfaces import SurfaceHit

ON_TRIANGLE = 1e-3
"""How far off a triangle, as a share of its size, a hit may lie that was reported on it."""

SAME_PLACE = 1e-5
"""Matrices that differ by no more place the same instance; Blender keeps them in float32."""


@dataclass(frozen=True)
class Looks:
    """One row per piece. reflectance, emission (W/m²): (p, 3) float32, linear Rec.709. tags: (p,) int32."""

    reflectance: Float32
    emission: Float32
    tags: np.ndarray


class _Slot(NamedTuple):
    """As much of a material slot as is read."""

    material: Any


class _Owner(NamedTuple):
    """As much of an object as decides the looks of its mesh: Blender's own are gone when it has gone through its
    instances."""

    name: str
    material_slots: tuple[_Slot, ...]


class _Surface:
    """An evaluated mesh with the materials that it shows."""

    def __init__(self, thing: Any, mesh: Any) -> None:
        self.owner = _Owner(thing.name, tuple(_Slot(slot.material) for slot in thing.material_slots))
        self.mesh = mesh
        self._triangles: dict[int, list[tuple[list[int], list[int], Float64]]] = {}
        if mesh is not None:
            mesh.calc_loop_triangles()

    def triangles(self, face: int) -> list[tuple[list[int], list[int], Float64]]:
        """Vertices, loops and (3, 3) local corners of the triangles of a face; none where there is no such face."""
        if face not in self._triangles:
            self._triangles[face] = self._read(face)
        return self._triangles[face]

    def _read(self, face: int) -> list[tuple[list[int], list[int], Float64]]:
        if self.mesh is None or face >= len(self.mesh.polygons):
            return []
        polygon = self.mesh.polygons[face]
        # Triangles follow each other in order of faces, two fewer than each face has corners.
        first = polygon.loop_start - 2 * face
        found = []
        for number in range(first, first + polygon.loop_total - 2):
            triangle = self.mesh.loop_triangles[number]
            vertices = list(triangle.vertices)
            corners = np.array([self.mesh.vertices[vertex].co for vertex in vertices], np.float64)
            found.append((vertices, list(triangle.loops), corners))
        return found


@dataclass(frozen=True)
class _Under:
    """The triangle under a piece: its corners in the mesh, and (3, 3) their weights at the piece's corners."""

    surface: _Surface
    face: int
    vertices: list[int]
    loops: list[int]
    weights: Float64
    object_tag: int


def looks_under(pieces: Float64, hits: Sequence[SurfaceHit | None], depsgraph: Any) -> Looks:
    """The looks of the surface under each piece; zero where nothing was hit, or what was hit cannot be read.

    pieces: (p, 3, 3) float64 world. hits: the surface under the middle of each.
    """
    reader = _Reader(depsgraph)
    reflectance, emission = np.zeros((2, len(pieces), 3), np.float32)
    tags = np.full(len(pieces), UNTAGGED, np.int32)
    try:
        by_surface: dict[int, list[tuple[int, _Under]]] = {}
        for row, hit in enumerate(hits):
            under = None if hit is None else reader.triangle(hit, pieces[row])
            if under is not None:
                tags[row] = _tag(under)
                by_surface.setdefault(id(under.surface), []).append((row, under))
        for found in by_surface.values():
            rows = [row for row, _ in found]
            reflectance[rows], emission[rows] = reader.averages([under for _, under in found])
    finally:
        reader.close()
    return Looks(reflectance, emission, tags)


class _Reader:
    """Reads single triangles of evaluated meshes; `close` gives temporary meshes back."""

    def __init__(self, depsgraph: Any) -> None:
        self._depsgraph = depsgraph
        self._extractor = material_reader(depsgraph)
        self._surfaces: dict[tuple[str, str | None], _Surface] = {}
        self._instances: dict[tuple[tuple[str, str | None], bytes], list[_Surface]] = {}
        self._tags: dict[tuple[tuple[str, str | None], bytes], int] = {}
        self._temporary: list[Any] = []

    def close(self) -> None:
        for thing in self._temporary:
            thing.to_mesh_clear()
        forget_large()

    def triangle(self, hit: SurfaceHit, piece: Float64) -> _Under | None:
        """The triangle that was hit. Blender names the owner of instances that geometry nodes make, not what is
        instanced: then the instance in that place is looked for."""
        original = bpy.data.objects.get(hit.key)
        if original is None:
            return None
        tag = int(given_by_hand(whole_number(original, TAG_PROPERTY))) or self._instancer_tag(original, hit)
        if hit.key not in self._surfaces:
            self._surfaces[hit.key] = self._own(original)
        found = _under(self._surfaces[hit.key], tag, hit, piece)
        if found is not None:
            return found
        place = (hit.key, hit.matrix.tobytes())
        if place not in self._instances:
            self._instances[place] = self._instanced(original, hit)
        return next(filter(None, (_under(surface, tag, hit, piece) for surface in self._instances[place])), None)

    def _instancer_tag(self, original: Any, hit: SurfaceHit) -> int:
        """Tag of what instances an object of no tag of its own in the place of the hit."""
        place = (hit.key, hit.matrix.tobytes())
        if place not in self._tags:
            own = np.allclose(np.array(original.matrix_world), hit.matrix, atol=SAME_PLACE)
            self._tags[place] = UNTAGGED if own else self._tag_of_instance(original, hit)
        return self._tags[place]

    def _tag_of_instance(self, original: Any, hit: SurfaceHit) -> int:
        for instance in self._depsgraph.object_instances:
            if not instance.is_instance or instance.parent is None or instance.object.original != original:
                continue
            if np.allclose(np.array(instance.matrix_world), hit.matrix, atol=SAME_PLACE):
                return int(given_by_hand(whole_number(instance.parent.original, TAG_PROPERTY)))
        return UNTAGGED

    def _own(self, original: Any) -> _Surface:
        thing = original.evaluated_get(self._depsgraph)
        if thing.type == "MESH" and original.mode != "EDIT":
            return _Surface(thing, thing.data)
        self._temporary.append(thing)
        return _Surface(thing, thing.to_mesh())

    def _instanced(self, original: Any, hit: SurfaceHit) -> list[_Surface]:
        found = []
        for instance in self._depsgraph.object_instances:
            parent = instance.parent
            if not instance.is_instance or parent is None or parent.original != original:
                continue
            if instance.object.type == "MESH" and np.allclose(
                np.array(instance.matrix_world), hit.matrix, atol=SAME_PLACE
            ):
                found.append(_Surface(instance.object, instance.object.data))
        return found

    def averages(self, found: list[_Under]) -> tuple[Float32, Float32]:
        """Reflectance and emission of pieces over one mesh."""
        surface = found[0].surface
        mesh = surface.mesh
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
        return self._extractor.averages(surface.owner, local)


def _tag(under: _Under) -> int:
    """Tag that an artist gave the face, else that which one gave the object."""
    attribute = under.surface.mesh.attributes.get(TAG_ATTRIBUTE)
    if attribute is None or attribute.domain != "FACE" or attribute.data_type != "INT":
        return under.object_tag
    return int(given_by_hand(attribute.data[under.face].value)) or under.object_tag


def _under(surface: _Surface, tag: int, hit: SurfaceHit, piece: Float64) -> _Under | None:
    """The triangle of face `hit.face` that holds the hit, or None where the face is elsewhere."""
    best, least = None, ON_TRIANGLE
    points = np.concatenate([hit.location[None], piece])
    for vertices, loops, local in surface.triangles(hit.face):
        weights, off = _weights(local @ hit.matrix[:3, :3].T + hit.matrix[:3, 3], points)
        outside = max(-float(weights[0].min()), off)
        if outside < least:
            best, least = _Under(surface, hit.face, vertices, loops, weights[1:], tag), outside
    return best


def _weights(corners: Float64, points: Float64) -> tuple[Float64, float]:
    """(p, 3) barycentric weights of points projected onto a triangle's plane, and how far the first lies off it as a
    share of the triangle's size."""
    along, across, offsets = corners[1] - corners[0], corners[2] - corners[0], points - corners[0]
    a, b, c = float(along @ along), float(along @ across), float(across @ across)
    squared = a * c - b * b
    if not squared > 0.0:
        return np.full((len(points), 3), -np.inf), np.inf
    d, e = offsets @ along, offsets @ across
    second, third = (c * d - b * e) / squared, (a * e - b * d) / squared
    beside = offsets[0] - second[0] * along - third[0] * across
    off = float(beside @ beside) ** 0.5 / squared**0.25
    return np.stack([1.0 - second - third, second, third], axis=1), off


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
