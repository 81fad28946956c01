# SPDX-License-Identifier: GPL-3.0-or-later
"""The geometry of light meshes for tools that draw: the same in object mode and in edit mode."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bmesh
import numpy as np

from ...core.scene import Float64
from ..extraction.mesh_arrays import read


@contextmanager
def edited(thing: Any) -> Iterator[Any]:
    """The BMesh of a mesh object in either mode; what is changed in it is written when the block ends without error."""
    if thing.mode == "EDIT":
        mesh = bmesh.from_edit_mesh(thing.data)
        yield mesh
        bmesh.update_edit_mesh(thing.data)
        return
    mesh = bmesh.new()
    try:
        mesh.from_mesh(thing.data)
        yield mesh
        mesh.to_mesh(thing.data)
        thing.data.update()
    finally:
        mesh.free()


def vertices_world(thing: Any) -> Float64:
    """(v, 3) float64: the vertices of a mesh object as it is being edited, m, world."""
    if thing.mode == "EDIT":
        rows = [tuple(vertex.co) for vertex in bmesh.from_edit_mesh(thing.data).verts]
        local = np.array(rows, np.float64).reshape(-1, 3)
    else:
        local = read(thing.data.vertices, "co", np.float32, 3).astype(np.float64)
    matrix = np.array(thing.matrix_world, np.float64)
    placed: Float64 = local @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def rings_of(thing: Any) -> list[list[int]]:
    """The vertices of each face of a mesh object as it is being edited."""
    if thing.mode == "EDIT":
        edit_mesh = bmesh.from_edit_mesh(thing.data)
        edit_mesh.verts.index_update()
        return [[vertex.index for vertex in face.verts] for face in edit_mesh.faces]
    vertices = read(thing.data.loops, "vertex_index", np.int32)
    starts = read(thing.data.polygons, "loop_start", np.int32)
    return [ring.tolist() for ring in np.split(vertices, starts[1:])] if len(starts) else []
