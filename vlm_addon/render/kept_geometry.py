# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene's triangles on the device over frames: what has not changed is not sent again.

A camera that moves changes positions, tangents and what is constant over a triangle, since these are relative to a
place near it; an object that moves changes positions and normals; a material leaves all vertices as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from ..core.scene import Material, SceneSnapshot
from .digests import Digests
from .geometry import GpuGeometry, batch_key
from .kept import Kept
from .local_space import LocalSpace

if TYPE_CHECKING:
    import moderngl

GEOMETRY, MATERIALS, TEXTURES = "geometry", "materials", "texture"
# Fields of Mesh that each buffer of GpuGeometry holds, and whether it depends on the space.
_FIELDS: dict[str, tuple[tuple[str, ...], bool]] = {
    "in_position": (("positions", "triangles"), True),
    "in_normal": (("corner_normals",), False),
    "in_uv": (("corner_uvs",), False),
    "in_color": (("corner_colors", "triangles"), False),
    "in_tangent": (("positions", "triangles", "corner_normals", "corner_uvs"), True),
    "triangles": (("positions", "triangles", "corner_normals", "material_indices", "tag_ids"), True),
}


def kept_geometry(context: moderngl.Context, kept: Kept, world: SceneSnapshot, space: LocalSpace) -> GpuGeometry:
    """The triangles of `world`, the snapshot in world space, in local units of `space`. Raises as GpuGeometry."""
    keys = _buffer_keys(kept.digests, world, space)

    def share(name: str, make: Callable[[], Any]) -> Any:
        names.append(name)
        return kept.several(_kind(name), keys[name], make)

    def make() -> tuple[GpuGeometry, list[str]]:
        return GpuGeometry(context, space.scene(world), np.zeros(3), share), names

    names: list[str] = []
    geometry, used = kept.several(GEOMETRY, kept.digests.of(keys, world.bounds()), make)
    if not names:
        for name in used:
            kept.several(_kind(name), keys[name], _never)
    return geometry


def _kind(name: str) -> str:
    if name.startswith(TEXTURES):
        return TEXTURES
    return name if name == MATERIALS else f"{GEOMETRY} {name.removeprefix('in_')}"


def _never() -> NoReturn:
    raise AssertionError("geometry is kept no longer than its buffers")


def _buffer_keys(digests: Digests, world: SceneSnapshot, space: LocalSpace) -> dict[str, str]:
    """Of each buffer and texture by the name that GpuGeometry gives it: a hash of all that it depends on."""
    meshes = [mesh for mesh in world.meshes if len(mesh.triangles)]
    materials = [replace(material, name="") for material in world.materials or (Material("default"),)]
    order = digests.of([mesh.material_indices for mesh in meshes], [batch_key(material) for material in materials])
    keys = {
        name: digests.of(
            order, [[getattr(mesh, field) for field in fields] for mesh in meshes], space if is_placed else ""
        )
        for name, (fields, is_placed) in _FIELDS.items()
    }
    keys[MATERIALS] = digests.of(materials)
    for index, texture in enumerate(world.textures):
        keys[f"{TEXTURES} {index}"] = digests.of(replace(texture, name=""))
    return keys
