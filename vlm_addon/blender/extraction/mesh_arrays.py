# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated Blender meshes as arrays, local and placed in the world. No Python loop runs over faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.errors import InvalidInput
from ...core.scene import Float32, Float64, Int32
from ..names import TAG_ATTRIBUTE

FARTHEST = 1e12
"""Metres beyond which float32 cannot hold volumes: what is there is a mistake."""

ATTRIBUTE_COMPONENTS = {"FLOAT": 1, "INT": 1, "BOOLEAN": 1, "FLOAT_COLOR": 4, "BYTE_COLOR": 4, "FLOAT_VECTOR": 3}
ATTRIBUTE_FIELDS = {"FLOAT_COLOR": "color", "BYTE_COLOR": "color", "FLOAT_VECTOR": "vector"}


@dataclass(frozen=True)
class LocalMesh:
    """One evaluated mesh in its own space.

    positions: (v, 3) float32. corners: (t, 3) int32 into the mesh's corners. triangles: (t, 3) int32 into positions.
    faces: (t,) int32, the face of each triangle. corner_normals: (t, 3, 3) float32. uv_maps: (t, 3, 2) by name.
    active_uv_map: name, "" for none. corner_colors: (t, 3, 3) float32 in the file's working space, by name.
    material_slots, face_tags: (t,) int32. source_face_count: faces of the mesh before triangulation.
    """

    positions: Float32
    triangles: Int32
    faces: Int32
    corner_normals: Float32
    uv_maps: dict[str, Float32]
    active_uv_map: str
    corner_colors: dict[str, Float32]
    material_slots: Int32
    face_tags: Int32


def read(collection: Any, field: str, dtype: Any, components: int = 1) -> np.ndarray:
    """All values of one field of a Blender collection: (n,) or (n, components) in `dtype`."""
    values = np.empty(len(collection) * components, dtype)
    collection.foreach_get(field, values)
    return values.reshape(-1, components) if components > 1 else values


def read_attribute(attribute: Any) -> np.ndarray:
    """Values of a mesh attribute: (n,) or (n, 3 or 4); float32, int32 or bool by its type."""
    dtype = {"INT": np.int32, "BOOLEAN": bool}.get(attribute.data_type, np.float32)
    field = ATTRIBUTE_FIELDS.get(attribute.data_type, "value")
    return read(attribute.data, field, dtype, ATTRIBUTE_COMPONENTS[attribute.data_type])


def face_attribute(mesh: Any, name: str, data_type: str) -> np.ndarray | None:
    """Values per face of the attribute of that name, or None where it is missing or of another type or domain."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.domain != "FACE" or attribute.data_type != data_type:
        return None
    return read_attribute(attribute)


def read_mesh(mesh: Any, owner: str) -> LocalMesh:
    """The arrays of a Blender mesh. Raises InvalidInput, naming `owner`, where a vertex is nowhere."""
    positions = read(mesh.vertices, "co", np.float32, 3).reshape(-1, 3)
    placed = (np.abs(positions) <= FARTHEST).all(axis=1)
    if not placed.all():
        vertex = int(np.flatnonzero(~placed)[0])
        problem = f"vertex {vertex} is at {tuple(positions[vertex].tolist())}"
        raise InvalidInput(owner, problem, "delete the vertex or repair what moves it")
    mesh.calc_loop_triangles()
    triangles = read(mesh.loop_triangles, "vertices", np.int32, 3).reshape(-1, 3)
    corners = read(mesh.loop_triangles, "loops", np.int32, 3).reshape(-1, 3)
    faces = read(mesh.loop_triangles, "polygon_index", np.int32)
    normals = read(mesh.corner_normals, "vector", np.float32, 3).reshape(-1, 3)
    slots = face_attribute(mesh, "material_index", "INT")
    tags = face_attribute(mesh, TAG_ATTRIBUTE, "INT")
    nothing = np.zeros(len(mesh.polygons), np.int32)
    active = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    return LocalMesh(
        positions=positions,
        triangles=triangles,
        faces=faces,
        corner_normals=normals[corners],
        uv_maps={layer.name: _uv(layer)[corners] for layer in mesh.uv_layers},
        active_uv_map=active,
        corner_colors={a.name: _corner_colors(a, triangles, corners) for a in mesh.color_attributes},
        material_slots=(nothing if slots is None else slots)[faces],
        face_tags=(nothing if tags is None else tags)[faces],
    )


def _uv(layer: Any) -> Float32:
    return read(layer.uv, "vector", np.float32, 2).reshape(-1, 2)


def _corner_colors(attribute: Any, triangles: Int32, corners: Int32) -> Float32:
    rows = triangles if attribute.domain == "POINT" else corners
    return np.ascontiguousarray(read_attribute(attribute)[rows][..., :3])


def cofactors(matrix: Float64) -> Float64:
    """(3, 3): what turns area vectors and normals; the inverse transpose times the determinant, defined for all."""
    a, b, c = matrix[:3, :3].T
    return np.column_stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


def place(local: LocalMesh, matrix: Float64) -> tuple[Float64, Int32, Float32, bool]:
    """Positions (float64), triangles, corner normals in the world, and whether the matrix mirrors.

    A mirrored mesh has its winding turned, so that its front stays its front.
    """
    positions = local.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0.0)
    turn = cofactors(matrix) * (-1.0 if mirrored else 1.0)
    normals = local.corner_normals @ turn.T.astype(np.float32)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    np.divide(normals, lengths, out=normals, where=lengths > 0.0)
    triangles = local.triangles
    if mirrored:
        triangles, normals = flipped(triangles), flipped(normals)
    return positions, triangles, np.ascontiguousarray(normals, np.float32), mirrored


def flipped(per_corner: np.ndarray) -> np.ndarray:
    """(t, 3, ...) with the second and third corner exchanged."""
    return np.ascontiguousarray(per_corner[:, [0, 2, 1]])
