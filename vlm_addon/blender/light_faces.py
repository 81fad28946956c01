# SPDX-License-Identifier: GPL-3.0-or-later
"""The face attributes of light meshes, read and written as arrays in object mode and in edit mode alike.

In edit mode Blender keeps a mesh as BMesh and its attributes are empty; here both look the same.
"""

from __future__ import annotations

from typing import Any

import bmesh
import numpy as np
import numpy.typing as npt

from ..core.errors import InvalidInput
from .extraction.mesh_arrays import ATTRIBUTE_COMPONENTS, ATTRIBUTE_FIELDS, read
from .names import (
    AREA_SCALE_ATTRIBUTE,
    COLOR_ATTRIBUTE,
    EMISSION_ATTRIBUTE,
    LOCK_ATTRIBUTE,
    MARK_ATTRIBUTE,
    TAG_ATTRIBUTE,
)

Bool = npt.NDArray[np.bool_]

TYPES = {
    COLOR_ATTRIBUTE: "FLOAT_COLOR",
    EMISSION_ATTRIBUTE: "FLOAT_COLOR",
    TAG_ATTRIBUTE: "INT",
    AREA_SCALE_ATTRIBUTE: "FLOAT",
    LOCK_ATTRIBUTE: "INT",
    MARK_ATTRIBUTE: "INT",
}
DEFAULTS: dict[str, tuple[float, ...]] = {
    COLOR_ATTRIBUTE: (1.0, 1.0, 1.0, 1.0),
    EMISSION_ATTRIBUTE: (0.0, 0.0, 0.0, 1.0),
    TAG_ATTRIBUTE: (0,),
    AREA_SCALE_ATTRIBUTE: (1.0,),
    LOCK_ATTRIBUTE: (0,),
    MARK_ATTRIBUTE: (0,),
}
"""What a face has where the attribute is missing."""
LAYERS = {"FLOAT_COLOR": "float_color", "INT": "int", "FLOAT": "float"}
DTYPES: dict[str, npt.DTypeLike] = {"FLOAT_COLOR": np.float32, "INT": np.int32, "FLOAT": np.float32}


def face_count(thing: Any) -> int:
    """Faces of a mesh object, as it is being edited."""
    return len(bmesh.from_edit_mesh(thing.data).faces) if thing.data.is_editmode else len(thing.data.polygons)


def chosen_faces(thing: Any) -> Bool:
    """(n,) bool: the selected, visible faces in edit mode; all faces otherwise."""
    if not thing.data.is_editmode:
        return np.ones(len(thing.data.polygons), bool)
    return np.array([face.select and not face.hide for face in bmesh.from_edit_mesh(thing.data).faces], bool)


def select_faces(thing: Any, chosen: Bool) -> None:
    """Select just the faces of `chosen`, (n,) bool, in edit mode or for the next time that it is entered."""
    if thing.data.is_editmode:
        edited = bmesh.from_edit_mesh(thing.data)
        for face, select in zip(edited.faces, chosen.tolist(), strict=True):
            face.select_set(select)
        edited.select_flush_mode()
        bmesh.update_edit_mesh(thing.data, loop_triangles=False, destructive=False)
        return
    mesh = thing.data
    corners = np.zeros(len(mesh.vertices), bool)
    edges = np.zeros(len(mesh.edges), bool)
    loops = np.repeat(chosen, read(mesh.polygons, "loop_total", np.int32))
    corners[read(mesh.loops, "vertex_index", np.int32)[loops]] = True
    edges[read(mesh.loops, "edge_index", np.int32)[loops]] = True
    _drop_broken_edge_selection(mesh)
    mesh.vertices.foreach_set("select", corners)
    mesh.edges.foreach_set("select", edges)
    mesh.polygons.foreach_set("select", np.ascontiguousarray(chosen))
    mesh.update()


def _drop_broken_edge_selection(mesh: Any) -> None:
    """Blender 5.0 stores the selection of edges that it has computed itself as pairs of numbers, and crashes when it is
    set; without one, the next to be set is made anew."""
    stored = mesh.attributes.get(".select_edge")
    if stored is not None and stored.data_type != "BOOLEAN":
        mesh.attributes.remove(stored)


def read_faces(thing: Any, name: str) -> npt.NDArray[Any]:
    """Values per face of an attribute of TYPES: (n,) or (n, 4), float32 or int32; its default where it is missing."""
    kind = TYPES[name]
    if thing.data.is_editmode:
        edited = bmesh.from_edit_mesh(thing.data)
        layer = getattr(edited.faces.layers, LAYERS[kind]).get(name)
        values = _defaults(name, len(edited.faces)) if layer is None else _layer_values(edited, layer, kind)
        return values
    attribute = thing.data.attributes.get(name)
    if attribute is None:
        return _defaults(name, len(thing.data.polygons))
    _require_type(thing, attribute)
    return read(attribute.data, ATTRIBUTE_FIELDS.get(kind, "value"), DTYPES[kind], ATTRIBUTE_COMPONENTS[kind])


def write_faces(thing: Any, name: str, values: npt.NDArray[Any]) -> None:
    """Set an attribute of TYPES on all faces, making it where it is missing.

    values: (n,) or (n, 4). Raises InvalidInput where an attribute of that name is of another type or domain.
    """
    kind = TYPES[name]
    rows = np.ascontiguousarray(values, DTYPES[kind])
    if thing.data.is_editmode:
        edited = bmesh.from_edit_mesh(thing.data)
        layers = getattr(edited.faces.layers, LAYERS[kind])
        layer = layers.get(name) or layers.new(name)
        for face, value in zip(bmesh.from_edit_mesh(thing.data).faces, rows.tolist(), strict=True):
            face[layer] = value
        bmesh.update_edit_mesh(thing.data, loop_triangles=False, destructive=False)
        return
    attribute = thing.data.attributes.get(name) or thing.data.attributes.new(name, kind, "FACE")
    _require_type(thing, attribute)
    attribute.data.foreach_set(ATTRIBUTE_FIELDS.get(kind, "value"), rows.ravel())
    thing.data.update()


def _defaults(name: str, count: int) -> npt.NDArray[Any]:
    row = DEFAULTS[name]
    values = np.tile(np.array(row, DTYPES[TYPES[name]]), (count, 1))
    return values if len(row) > 1 else values[:, 0]


def _layer_values(edited: Any, layer: Any, kind: str) -> npt.NDArray[Any]:
    components = ATTRIBUTE_COMPONENTS[kind]
    rows = [tuple(face[layer]) if components > 1 else face[layer] for face in edited.faces]
    values = np.array(rows, DTYPES[kind])
    return values.reshape(-1, components) if components > 1 else values


def _require_type(thing: Any, attribute: Any) -> None:
    wanted = TYPES[attribute.name]
    if attribute.domain != "FACE" or attribute.data_type != wanted:
        problem = f"attribute {attribute.name!r} is {attribute.data_type} on {attribute.domain}, not {wanted} on FACE"
        raise InvalidInput(f"light mesh {thing.name!r}", problem, "rename or remove it (Object Data > Attributes)")
