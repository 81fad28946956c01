# SPDX-License-Identifier: GPL-3.0-or-later
"""What casts shadows in a scene, in a space that no camera moves, and on what of it each lamp's maps depend.

Maps drawn from it stay right while the lamp and what it can shine on stay as they are, wherever the camera goes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.reach import Bools, box_corners, in_reach
from ..core.scene import NO_TEXTURE, Light, Material, Mesh, SceneSnapshot
from .geometry import GpuGeometry
from .kept import Kept
from .local_space import LocalSpace, make_still_space
from .shadow_windows import Bounds

if TYPE_CHECKING:
    import moderngl

KIND = "shadow casters"


class ShadowCasters:
    """Of one frame; what is on the device is kept over frames. space: of the casters. low, high: (3,) float64, bounds
    of the whole scene there. triangle_count, has_alpha: as GpuGeometry."""

    def __init__(
        self,
        context: moderngl.Context,
        kept: Kept,
        world: SceneSnapshot,
        occluders: Sequence[Bools] | None = None,
        space: LocalSpace | None = None,
    ) -> None:
        """world: the snapshot in world space. occluders: which triangles of each mesh may stand before another; None
        for all. space: another one than that which no camera moves."""
        casting = world.meshes if occluders is None else map(_part, world.meshes, occluders)
        meshes = tuple(mesh for mesh in casting if len(mesh.triangles))
        materials = world.materials or (Material("default"),)
        bounds = world.bounds()
        self.space = make_still_space(*bounds) if space is None else space
        self.low, self.high = (self.space.local_points(corner) for corner in bounds)
        self.triangle_count = sum(len(mesh.triangles) for mesh in meshes)
        self._context, self._kept = context, kept
        self._world = replace(world, meshes=meshes, materials=materials, camera=None, lights=())
        textures = [kept.digests.of(replace(texture, name="")) for texture in world.textures]
        lets_through = [_alpha_key(material, textures) for material in materials]
        self._keys, self.has_alpha, first = [], False, 0
        for mesh in meshes:
            key: list[Any] = [mesh.positions, mesh.triangles]
            if any(lets_through):
                alpha = [(slot, lets_through[slot]) for slot in np.unique(mesh.material_indices).tolist()]
                if any(look for _, look in alpha):
                    # What is let through by chance hangs on the number of the triangle.
                    key += [mesh.corner_uvs, mesh.material_indices, alpha, first]
                    self.has_alpha = True
            self._keys.append(kept.digests.of(key))
            first += len(mesh.triangles)
        corners = [box_corners(*mesh.bounds()) for mesh in meshes]
        self._corners = np.array(corners).reshape(-1, 8, 3)
        self._geometry: GpuGeometry | None = None

    def geometry(self) -> GpuGeometry:
        """The casters on the device, sent there where they are not yet; for shadow maps alone."""
        if self._geometry is None:
            key = self._kept.digests.of(self.space, self._keys)
            self._geometry = self._kept.get(KIND, key, self._upload)
        return self._geometry

    def _upload(self) -> GpuGeometry:
        return GpuGeometry(self._context, self.space.scene(self._world), np.zeros(3), for_shadows=True)

    def seen_by(self, light: Light, widening: float) -> tuple[str, Bounds | None]:
        """Key of all that can show in a map of `light`, in world space, and lower and upper corner of it in `space`;
        None for nothing. widening: of the tangents of a map that shows a cone; 0 for a map of all directions."""
        chosen = np.ones(len(self._keys), bool)
        if widening > 0.0:
            angle = 2.0 * math.atan(widening * math.tan(0.5 * light.spot_angle))
            chosen = in_reach(replace(light, spot_angle=angle), self._corners)
        if not chosen.any():
            return "", None
        bounds = self.low, self.high
        if not chosen.all():
            corners = self.space.local_points(self._corners[chosen].reshape(-1, 3))
            bounds = corners.min(axis=0), corners.max(axis=0)
        keys = [key for key, is_chosen in zip(self._keys, chosen, strict=True) if is_chosen]
        return self._kept.digests.of(self.space, keys, bounds), bounds


def _part(mesh: Mesh, chosen: Bools) -> Mesh:
    """The mesh itself where all of it is chosen."""
    return mesh if chosen.all() else mesh.subset(chosen)


def _alpha_key(material: Material, textures: list[str]) -> str:
    """Of how a material lets light through; "" where it lets none."""
    if material.alpha >= 1.0 and material.alpha_texture == NO_TEXTURE:
        return ""
    texture = "" if material.alpha_texture == NO_TEXTURE else textures[material.alpha_texture]
    return f"{material.alpha!r} {texture} {material.alpha_channel}"
