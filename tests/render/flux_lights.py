# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that FluxLightPass places in a scene, and all that its maps hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np

from vlm_addon.core.light_walk import surface_means
from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.core.vpl import VirtualPointLights
from vlm_addon.render.device import Device
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.bounce_lights import BounceLightPass
from vlm_addon.render.passes.flux_lights import FluxLightPass
from vlm_addon.render.passes.rsm import LampReflections
from vlm_addon.render.scene_octree import scene_octree

WORLD = LocalSpace(np.zeros(3), 1.0)
RESOLUTION, AREA_MAPS, OCTREE_RESOLUTION = 64, 4, 32


def maps_of(device: Device, scene: SceneSnapshot, resolution: int = RESOLUTION) -> LampReflections:
    """Of a scene; within `device.current()`."""
    return LampReflections(device.context, device.shaders, Kept(), scene, resolution, AREA_MAPS)


def placed(
    device: Device,
    scene: SceneSnapshot,
    count: int,
    first: int = 1,
    shifts: list[tuple[float, float]] | None = None,
    space: LocalSpace = WORLD,
    resolution: int = RESOLUTION,
) -> list[np.ndarray]:
    """(count,) records of VIRTUAL_POINT_LIGHT for each shift, all of the same maps."""
    with device.current() as context:
        maps = maps_of(device, scene, resolution)
        lights = FluxLightPass(context, device.shaders)
        wanted = shifts if shifts is not None else [(0.0, 0.0)]
        return [lights.render(maps, space, count, first, shift).records().copy() for shift in wanted]


def coloured(scene: SceneSnapshot) -> SceneSnapshot:
    """With triangles that reflect as their materials do; small scenes from code leave that black."""
    colours = np.array([material.base_color for material in scene.materials], np.float32)
    meshes = [replace(mesh, reflectance=colours[mesh.material_indices]) for mesh in scene.meshes]
    return replace(scene, meshes=tuple(meshes))


def walked(
    device: Device,
    scene: SceneSnapshot,
    counts: Sequence[int],
    first: int = 1,
    shifts: list[tuple[float, float]] | None = None,
    space: LocalSpace = WORLD,
) -> list[list[np.ndarray]]:
    """Records of VIRTUAL_POINT_LIGHT of each bounce, for each shift; the first of `counts` is of the first bounce."""
    coloured_scene = coloured(scene)
    area = surface_means(coloured_scene.meshes).area
    found = []
    with device.current() as context:
        maps, kept = maps_of(device, coloured_scene), Kept()
        octree = scene_octree(context, device.shaders, kept, coloured_scene, OCTREE_RESOLUTION)
        place, bounce = FluxLightPass(context, device.shaders), BounceLightPass(context, device.shaders)
        for shift in shifts if shifts is not None else [(0.0, 0.0)]:
            lights = [place.render(maps, space, counts[0], first, shift)]
            for number, count in enumerate(counts[1:], 2):
                lights.append(bounce.render(lights[-1], octree, space, count, number, first, shift, area))
            found.append([part.records().copy() for part in lights])
    return found


@dataclass(frozen=True)
class MapTexels:
    """One map in world space. positions, normals, geometric_normals, flux: (h, w, 3); areas: (h, w). side: of a face,
    texels. share: of MapFluxes."""

    positions: Float64
    normals: Float64
    geometric_normals: Float64
    flux: Float64
    areas: Float64
    side: int
    share: float


def map_texels(device: Device, scene: SceneSnapshot, resolution: int = RESOLUTION) -> list[MapTexels]:
    """What the maps of a scene hold."""

    def read(texture: moderngl.Texture) -> Float64:
        width, height = texture.size
        return np.frombuffer(texture.read(), np.float32).reshape(height, width, 4).astype(float)

    texels = []
    with device.current():
        maps = maps_of(device, scene, resolution)
        for found, share in zip(maps.maps(), maps.fluxes().shares, strict=True):
            position, normal, flux, facet = (
                read(texture) for texture in (found.position, found.normal, found.flux, found.geometric_normal)
            )
            unit = found.space.unit
            places = found.space.world_points(position[..., :3])
            areas = normal[..., 3] * unit**2
            values = places, normal[..., :3], facet[..., :3], flux[..., :3] * unit**2, areas
            texels.append(MapTexels(*values, found.side, float(share)))
    return texels


def all_texels(maps: list[MapTexels]) -> VirtualPointLights:
    """Every texel as a light without extent: what the maps hold, summed without a choice."""
    parts = [
        np.concatenate([getattr(m, name).reshape(-1, 3) for m in maps]) for name in ("positions", "normals", "flux")
    ]
    lit = parts[2].max(axis=1) > 0.0
    return VirtualPointLights(*(part[lit] for part in parts), np.zeros(int(lit.sum())))


def as_lights(records: np.ndarray) -> VirtualPointLights:
    """Without extent, so that sums over few and over many are comparable."""
    values = (records[name].astype(float) for name in ("position", "normal", "flux"))
    return VirtualPointLights(*values, np.zeros(len(records)))
