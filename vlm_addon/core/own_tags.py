# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags for chosen lights and for the surface that they stand for, beside those that an artist has given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .mesh_topology import Int64
from .scene import UNTAGGED, Int32, Mesh
from .tag_pairs import add_tags
from .tags import next_tag


def tagged_regions(
    light_mesh: VirtualLightMesh,
    meshes: Sequence[Mesh],
    rows: Int64,
    light_of_triangle: Sequence[npt.ArrayLike],
    face_of_triangle: Sequence[npt.ArrayLike] | None = None,
) -> tuple[Int32, tuple[Int32, ...], Int32]:
    """(tags of all lights, tags of all triangles of each mesh, all links) with which the faces of the regions of the
    lights `rows` leave out these lights.

    Tags that there are stay: a light keeps its own, and where a face has another they are linked. light_of_triangle:
    for each mesh, (its triangles,) int, -1 for none. face_of_triangle: likewise, the face that each triangle is part
    of, every triangle by itself by default.
    """
    counts = [len(mesh.triangles) for mesh in meshes]
    lights, faces = _joined(light_of_triangle), _joined_faces(counts, face_of_triangle)
    chosen = np.zeros(len(light_mesh) + 1, bool)
    chosen[rows] = True
    held = np.flatnonzero(chosen[lights])
    old = np.concatenate([*[mesh.tag_ids for mesh in meshes], np.zeros(0, np.int32)])
    face_tags = np.full(int(faces.max(initial=-1)) + 1, UNTAGGED, np.int32)
    face_tags[faces] = old
    first = next_tag(light_mesh.tag_ids, old, light_mesh.links)
    found = add_tags(lights[held], faces[held], light_mesh.tag_ids, face_tags, light_mesh.links, first)
    triangle_tags = found.face_tags[faces]
    parts = tuple(np.split(triangle_tags, np.cumsum(counts)[:-1])) if counts else ()
    return found.light_tags, parts, found.links


def _joined(parts: Sequence[npt.ArrayLike]) -> Int64:
    return np.concatenate([*[np.asarray(part, np.int64) for part in parts], np.zeros(0, np.int64)])


def _joined_faces(counts: list[int], face_of_triangle: Sequence[npt.ArrayLike] | None) -> Int64:
    """The face of each triangle, numbered through over all meshes."""
    if face_of_triangle is None:
        return np.arange(sum(counts))
    parts, start = [np.zeros(0, np.int64)], 0
    for part in face_of_triangle:
        faces = np.asarray(part, np.int64)
        parts.append(faces + start)
        start += int(faces.max(initial=-1)) + 1
    return np.concatenate(parts)
