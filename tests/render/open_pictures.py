# SPDX-License-Identifier: GPL-3.0-or-later
"""How open the pixels of a scene are by the pass, and by rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vlm_addon.core.ambient_occlusion import openness
from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.core.triangle_tree import build_tree
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.ambient_occlusion import AmbientOcclusionPass, OcclusionSettings
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.rsm import LampReflections
from vlm_addon.render.view import make_view

SIZE = (56, 40)
PICTURES = 16
RESOLUTION = 128


@dataclass(frozen=True)
class Seen:
    """Mean openness of pictures, and what the pixels show, (h, w) and (h, w, 3), row 0 at the top, world space.

    normals: those that the cosine is about; planes: of the triangles.
    """

    open: Float64
    positions: Float64
    normals: Float64
    planes: Float64
    radius_m: float

    def on(self, axis: int, value: float) -> np.ndarray:
        """(h, w): pixels of the plane on which a coordinate has a value."""
        return (np.abs(self.positions[..., axis] - value) < 1e-4) & np.any(self.normals != 0.0, axis=2)


def look(
    device: Device,
    snapshot: SceneSnapshot,
    radius_m: float,
    pictures: int = PICTURES,
    size: tuple[int, int] = SIZE,
    with_maps: bool = False,
    **values: object,
) -> Seen:
    """Openness of the same pixels' middles from several sets of directions."""
    low, high = snapshot.bounds()
    share = radius_m / float(np.linalg.norm(high - low))
    settings = OcclusionSettings(radius=share, **values)  # type: ignore[arg-type]
    with device.current() as context:
        space = make_local_space(snapshot)
        local = space.scene(snapshot)
        assert local.camera is not None
        geometry = GpuGeometry(context, local, np.zeros(3))
        view = make_view(local.camera, *size, geometry.origin)
        chosen = AmbientOcclusionPass(context, device.shaders, *size, settings)
        surfaces = GBufferPass(context, device.shaders, *size)
        found = LampReflections(context, device.shaders, Kept(), snapshot, RESOLUTION, 2) if with_maps else None
        total = np.zeros(size[::-1])
        for index in range(pictures):
            gbuffer = surfaces.render(geometry, view, 0)
            maps = () if found is None else found.maps()
            total += read_image(chosen.render(gbuffer, view, index, maps, space))[..., 0]
        textures = gbuffer.position, gbuffer.shading_normal, gbuffer.geometric_normal
        positions, normals, planes = (read_image(texture)[..., :3] for texture in textures)
        points = space.world_points(positions)
        return Seen(total / pictures, points, normals.astype(float), planes.astype(float), radius_m)


def by_rays(seen: Seen, snapshot: SceneSnapshot, strata: int = 12) -> Float64:
    """(h, w) openness by rays; 1 where nothing shows."""
    shown = np.any(seen.normals != 0.0, axis=2)
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes])
    points = seen.positions[shown], seen.normals[shown], seen.planes[shown]
    result = np.ones(shown.shape)
    result[shown] = openness(build_tree(corners), *points, seen.radius_m, strata)
    return result


def mean_error(found: Float64, truth: Float64, where: np.ndarray) -> float:
    return float(np.abs(found - truth)[where].mean())
