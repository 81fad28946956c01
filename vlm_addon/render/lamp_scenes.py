# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of a scene that a lamp can light, as a scene and a space of its own.

A map drawn from it depends on nothing else, so it is the same whatever the camera and the rest of the scene do, and
stays right while the lamp and what it can light stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..core.reach import Bools, box_corners, in_reach
from ..core.scene import NO_TEXTURE, Light, Material, SceneSnapshot
from .digests import Digests
from .geometry import TEXTURE_FIELDS
from .local_space import LocalSpace, make_local_space

_MESH_FIELDS = ("positions", "triangles", "corner_normals", "corner_uvs", "corner_colors")


@dataclass(frozen=True)
class LampScene:
    """The meshes that one lamp can light. light: in world space. key: of the meshes and how they look, the same for
    lamps that can light the same ones; lamp_key: of those and the lamp."""

    light: Light
    chosen: Bools
    key: str
    lamp_key: str


class LampScenes:
    """What each lamp of a scene can light."""

    def __init__(self, snapshot: SceneSnapshot, digests: Digests | None = None) -> None:
        """snapshot: in world space, its meshes usable (GpuGeometry). digests: of the frame, if there is one."""
        digests = digests or Digests()
        self._digests = digests
        meshes = tuple(mesh for mesh in snapshot.meshes if len(mesh.triangles))
        materials = snapshot.materials or (Material("default"),)
        self._snapshot = replace(snapshot, meshes=meshes, materials=materials, camera=None)
        self._corners = np.array([box_corners(*mesh.bounds()) for mesh in meshes]).reshape(-1, 8, 3)
        self._used = [np.unique(mesh.material_indices, return_inverse=True) for mesh in meshes]
        textures = [digests.of(replace(texture, name="")) for texture in snapshot.textures]
        looks = [_look_hash(digests, material, textures) for material in materials]
        self._mesh_keys = np.array(
            [
                digests.of([getattr(mesh, name) for name in _MESH_FIELDS], places, [looks[i] for i in used])
                for mesh, (used, places) in zip(meshes, self._used, strict=True)
            ],
            dtype="S64",
        )

    def of(self, light: Light) -> LampScene:
        """What `light`, in world space, can light."""
        chosen = in_reach(light, self._corners)
        key = self._digests.of(self._mesh_keys[chosen])
        return LampScene(light, chosen, key, self._digests.of(key, replace(light, name="")))

    def local(self, scene: LampScene) -> tuple[SceneSnapshot, LocalSpace]:
        """The part as a snapshot in local units of a space of its own, both the same for the same key but for the lamp;
        `scene.light` is its only one."""
        materials: dict[int, int] = {}
        meshes = []
        for index in np.flatnonzero(scene.chosen):
            used, places = self._used[index]
            slots = np.array([materials.setdefault(int(slot), len(materials)) for slot in used], np.int32)
            meshes.append(replace(self._snapshot.meshes[index], material_indices=slots[places]))
        textures: dict[int, int] = {NO_TEXTURE: NO_TEXTURE}
        looks = [_with_textures(self._snapshot.materials[slot], textures) for slot in materials]
        part = replace(
            self._snapshot,
            meshes=tuple(meshes),
            materials=tuple(looks),
            textures=tuple(self._snapshot.textures[index] for index in textures if index != NO_TEXTURE),
            lights=(scene.light,),
        )
        space = make_local_space(part)
        return space.scene(part), space


def _look_hash(digests: Digests, material: Material, textures: list[str]) -> str:
    look: dict[str, Any] = {field.name: getattr(material, field.name) for field in fields(material)}
    del look["name"]
    for name in TEXTURE_FIELDS.values():
        look[name] = textures[look[name]] if look[name] != NO_TEXTURE else ""
    return digests.of(look)


def _with_textures(material: Material, places: dict[int, int]) -> Material:
    """`material` with its textures renumbered; `places` grows by those it had not."""
    # NO_TEXTURE is among them from the start.
    named = {name: getattr(material, name) for name in TEXTURE_FIELDS.values()}
    renumbered: dict[str, Any] = {name: places.setdefault(index, len(places) - 1) for name, index in named.items()}
    return replace(material, **renumbered)
