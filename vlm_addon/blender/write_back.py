# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes into the open file as ordinary mesh objects (the table in docs/architecture.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..core.errors import InvalidInput
from ..core.light_links import make_links, no_links
from ..core.light_mesh import VirtualLightMesh, require_valid
from ..core.scene import Float64, Int32
from .extraction.color_space import convert, rec709_to_working
from .light_factors import set_neutral_factors
from .light_meshes import set_sources
from .names import (
    AREA_SCALE_ATTRIBUTE,
    COLLECTION,
    COLOR_ATTRIBUTE,
    DYNAMIC_PROPERTY,
    EMISSION_ATTRIBUTE,
    SCHEMA_PROPERTY,
    SCHEMA_VERSION,
    TAG_ATTRIBUTE,
    is_light_mesh,
)
from .tagging.stored_links import read_links, write_links


def write_light_mesh(light_mesh: VirtualLightMesh, name: str, sources: Sequence[str] = (), scene: Any = None) -> Any:
    """The object that now holds `light_mesh` under `name`, in the collection of light meshes of `scene`.

    A light mesh of that name is replaced: the object stays, with its collections, modifiers, strength, hue and the
    links of tags that there still are, without a rotation or scale of its own; its old mesh is removed where nothing
    else uses it. sources: names of the objects that it was made from, kept for the artist. scene: the current one by
    default. Raises InvalidInput for lights that `require_valid` refuses and for linked data, which cannot be changed.
    """
    require_valid(light_mesh)
    scene = scene or bpy.context.scene
    existing = _existing(name, scene)
    links = _links(existing, light_mesh)
    # Around their own middle, float32 coordinates are as exact as the placement behind the surface needs them.
    middle = _middle(light_mesh.vertices)
    mesh = _new_mesh(light_mesh, middle, name)
    if existing is None:
        blender_object = bpy.data.objects.new(name, mesh)
        _collection(scene).objects.link(blender_object)
        set_neutral_factors(blender_object)
    else:
        blender_object = existing
        _replace_mesh(blender_object, mesh, name)
    blender_object.matrix_world = Matrix.Translation(middle)
    blender_object[SCHEMA_PROPERTY] = SCHEMA_VERSION
    blender_object[DYNAMIC_PROPERTY] = bool(light_mesh.dynamic.any())
    set_sources(blender_object, sources, scene)
    write_links(blender_object, links)
    blender_object.hide_render = True
    blender_object.display_type = "WIRE"
    return blender_object


def _links(existing: Any | None, light_mesh: VirtualLightMesh) -> Int32:
    """Those of the lights, beside those that an artist has made for ids that are still there."""
    kept = no_links() if existing is None else read_links(existing)
    kept = kept[np.isin(kept[:, 0], light_mesh.tag_ids)]
    return make_links(np.concatenate([kept, light_mesh.links]))


def _existing(name: str, scene: Any) -> Any | None:
    """The light mesh of that name in the scene. Raises InvalidInput where it is linked or in edit mode."""
    found = scene.objects.get(name)
    if found is None or found.type != "MESH" or not is_light_mesh(found):
        return None
    subject = f"light mesh {name!r}"
    if found.library is not None or found.override_library is not None:
        raise InvalidInput(subject, "it is linked from another file", "make it local or choose another name")
    if found.mode == "EDIT":
        raise InvalidInput(subject, "it is being edited", "leave edit mode and try again")
    return found


def _collection(scene: Any) -> Any:
    """The scene's collection of light meshes, made and linked where it is missing."""
    for collection in scene.collection.children_recursive:
        if collection.name.startswith(COLLECTION) and collection.library is None:
            return collection
    collection = bpy.data.collections.new(COLLECTION)
    scene.collection.children.link(collection)
    return collection


def _middle(vertices: Float64) -> Float64:
    """Middle of the bounding box, (3,) float64 that float32 can hold."""
    if not len(vertices):
        return np.zeros(3)
    return (0.5 * (vertices.min(axis=0) + vertices.max(axis=0))).astype(np.float32).astype(np.float64)


def _new_mesh(light_mesh: VirtualLightMesh, middle: Float64, name: str) -> Any:
    mesh = bpy.data.meshes.new(name)
    vertices, triangles = light_mesh.vertices - middle, light_mesh.triangles
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).ravel())
    mesh.loops.add(3 * len(triangles))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(triangles), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    matrix = rec709_to_working()
    _set_colors(mesh, COLOR_ATTRIBUTE, convert(light_mesh.colour, matrix))
    _set_colors(mesh, EMISSION_ATTRIBUTE, convert(light_mesh.emission, matrix))
    _set_values(mesh, TAG_ATTRIBUTE, "INT", light_mesh.tag_ids.astype(np.int32))
    _set_values(mesh, AREA_SCALE_ATTRIBUTE, "FLOAT", light_mesh.strength.astype(np.float32))
    return mesh


def _set_colors(mesh: Any, name: str, colors: np.ndarray) -> None:
    rgba = np.ones((len(colors), 4), np.float32)
    rgba[:, :3] = colors
    mesh.attributes.new(name, "FLOAT_COLOR", "FACE").data.foreach_set("color", rgba.ravel())


def _set_values(mesh: Any, name: str, data_type: str, values: np.ndarray) -> None:
    mesh.attributes.new(name, data_type, "FACE").data.foreach_set("value", values)


def _replace_mesh(blender_object: Any, mesh: Any, name: str) -> None:
    old = blender_object.data
    blender_object.data = mesh
    if not old.users:
        bpy.data.meshes.remove(old)
        mesh.name = name
