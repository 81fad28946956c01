# SPDX-License-Identifier: GPL-3.0-or-later
"""One light mesh object for each source that moves by itself: an object has one parent and one rig."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bmesh
import numpy as np

from ..baking.bake_state import readable_made_from, set_made_from
from ..extraction.mesh_arrays import read
from ..light_meshes import set_sources, source_names, sources
from ..names import NAME
from .surface_transfer import evaluated_surface, nearest, normals_to_world, to_world


def separate_by_source(thing: Any, found: Sequence[Any], moving: Sequence[Any], context: Any) -> list[tuple[Any, Any]]:
    """Light meshes that stand for one of the `moving` sources each, with that source; lights of others stay in `thing`.

    found: the sources of the light mesh. A light belongs to the source nearest to its middle that faces as it does.
    `thing` keeps what is left, or, where nothing is, stands for the last of `moving`.
    """
    owners = _owners(thing, found, context)
    made_from = readable_made_from(thing, context.scene)
    # The source that the light mesh is named after comes last: it is the one that may keep it.
    ordered = sorted(moving, key=lambda source: thing.name == f"{NAME} {source.name}")
    parts: list[tuple[Any, Any]] = []
    for source in ordered:
        mine = owners == found.index(source)
        if not mine.any():
            continue
        if mine.all():
            _stands_for(thing, [source.name], made_from, context.scene)
            return [*parts, (thing, source)]
        parts.append((_taken_out(thing, mine, source, context), source))
        _stands_for(parts[-1][0], [source.name], made_from, context.scene)
        owners = owners[~mine]
    if parts:
        gone = [source for _, source in parts]
        known = zip(source_names(thing), sources(thing, context.scene), strict=True)
        left = [name if source is None else source.name for name, source in known if source not in gone]
        _stands_for(thing, left, made_from, context.scene)
    return parts


def _stands_for(thing: Any, names: list[str], made_from: dict[str, str], scene: Any) -> None:
    """Only these objects, by their present names, are what `thing` was made from."""
    set_sources(thing, names, scene)
    if made_from:
        set_made_from(thing, {name: found for name, found in made_from.items() if name in names})


def has_lights_of(thing: Any, found: Sequence[Any], moving: Sequence[Any], context: Any) -> bool:
    """Whether any light of `thing` stands for one of the `moving` sources among those that are `found`."""
    wanted = [found.index(source) for source in moving]
    return bool(np.isin(_owners(thing, found, context), wanted).any())


def _owners(thing: Any, found: Sequence[Any], context: Any) -> np.ndarray:
    """(faces,) row in `found` of the source that each face stands for."""
    surface = evaluated_surface(found, context.evaluated_depsgraph_get())
    matrix = np.array(thing.matrix_world, np.float64)
    centers = to_world(read(thing.data.polygons, "center", np.float32, 3).reshape(-1, 3), matrix)
    normals = read(thing.data.polygons, "normal", np.float32, 3).reshape(-1, 3).astype(np.float64)
    return surface.owners[nearest(surface, centers, normals_to_world(normals, matrix)).triangles]


def _taken_out(thing: Any, mine: np.ndarray, source: Any, context: Any) -> Any:
    """A new light mesh with the faces `mine` of `thing`, which loses them."""
    name = f"{NAME} {source.name}"
    copy = thing.copy()
    copy.name = name
    copy.data = thing.data.copy()
    copy.data.name = name
    for collection in thing.users_collection:
        collection.objects.link(copy)
    _delete_faces(thing.data, mine)
    _delete_faces(copy.data, ~mine)
    return copy


def _delete_faces(mesh: Any, gone: np.ndarray) -> None:
    edited = bmesh.new()
    try:
        edited.from_mesh(mesh)
        faces = [face for face, delete in zip(edited.faces, gone.tolist(), strict=True) if delete]
        bmesh.ops.delete(edited, geom=faces, context="FACES")
        edited.to_mesh(mesh)
    finally:
        edited.free()
    mesh.update()
