# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that FluxLightPass places in a scene, and all that its maps hold."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.core.vpl import VirtualPointLights
from vlm_addon.render.device import Device
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.flux_lights import FluxLightPass
from vlm_addon.render.passes.rsm import LampReflections

WORLD = LocalSpace(np.zeros(3), 1.0)
RESOLUTION, AREA_MAPS = 64, 4


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
