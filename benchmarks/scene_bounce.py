# SPDX-License-Identifier: GPL-3.0-or-later
"""The bounce of a scene by brute force at points of its surface: every source triangle a light, or any other lights."""

from __future__ import annotations

from typing import Any

import numpy as np

from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.mesh_topology import Rows
from vlm_addon.core.morton import morton_codes
from vlm_addon.core.progress import silent
from vlm_addon.core.sampling import sample_regions
from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.core.source_surface import SourceSurface
from vlm_addon.core.surface_points import SurfacePoints, random_surface_points
from vlm_addon.core.world_light import world_lights
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.lamp_shadows import LampShadows
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBuffer
from vlm_addon.render.passes.phase_one import PhaseOnePass
from vlm_addon.render.passes.phase_two import PhaseTwoPass
from vlm_addon.render.passes.tile_bounds import TILE_SIDE as TILE
from vlm_addon.render.virtual_lights import GpuVirtualLights

COLUMNS, ROWS = 160, 128
POINTS = COLUMNS * ROWS
WORLD_LIGHTS = 64
SHADOW_SAMPLES = 16


def triangle_lights(surface: SourceSurface, samples: int = 1) -> VirtualLightMesh:
    """Every triangle of the surface a light of its own, where it is."""
    count = len(surface.triangles)
    each = Rows(np.arange(count), np.arange(count + 1))
    return VirtualLightMesh(
        vertices=surface.positions,
        triangles=surface.triangles.astype(np.int32),
        colour=surface.reflectance.astype(np.float32),
        emission=surface.emission.astype(np.float32),
        strength=np.ones(count, np.float32),
        tag_ids=np.zeros(count, np.int32),
        dynamic=np.zeros(count, bool),
        samples=sample_regions(surface.corners, each, np.full(count, samples)),
    )


def spread_points(snapshot: SceneSnapshot) -> SurfacePoints:
    """POINTS random points of the visible surface, neighbours in space next to each other."""
    points = random_surface_points(snapshot.meshes, POINTS, seed=1)
    order = np.argsort(morton_codes(points.positions), kind="stable")
    return SurfacePoints(points.positions[order], points.normals[order], points.tag_ids[order])


class Bounce:
    """Irradiance from lights at fixed points of one scene."""

    def __init__(self, device: Device, snapshot: SceneSnapshot, points: SurfacePoints) -> None:
        self._device = device
        self._snapshot = snapshot
        low, high = snapshot.bounds()
        self._origin = 0.5 * (low + high)
        with device.current() as context:
            position = self._texture(points.positions - self._origin)
            normal = self._texture(points.normals)
            ids = context.texture((COLUMNS, ROWS), 4, np.zeros((ROWS, COLUMNS, 4), np.int32).tobytes(), dtype="i4")
            self._picture = GBuffer(position, normal, normal, position, position, ids)
            self._sum = PhaseTwoPass(context, device.shaders, COLUMNS, ROWS)

    def _texture(self, values: Float64) -> Any:
        image = np.zeros((ROWS, COLUMNS, 4), np.float32)
        image[..., :3] = _in_tiles(values)
        return self._device.context.texture((COLUMNS, ROWS), 4, image.tobytes(), dtype="f4")

    def falling(self, surface: SourceSurface, samples: int) -> Float64:
        """(t, 3) W/m²: what falls on each triangle from the scene's lamps and its world, with shadows."""
        snapshot = self._snapshot
        world = world_lights(snapshot.world_radiance, snapshot.environment, WORLD_LIGHTS)
        lamps = (*snapshot.lights, *world)
        with self._device.current() as context:
            geometry = GpuGeometry(context, snapshot)
            shadows = LampShadows(context, self._device.shaders, geometry, lamps, RenderSettings.shadow_resolution)
            phase_one = PhaseOnePass(context, self._device.shaders)
            lights = triangle_lights(surface, samples)
            found = phase_one.render(lights, geometry.origin, shadows, range(len(lamps)), SHADOW_SAMPLES)
        return found.astype(np.float64)

    def irradiance(self, lights: VirtualLightMesh, radiosity: Float64) -> Float64:
        """(POINTS, 3) W/m² that lights of (n, 3) W/m² give, whatever stands between."""
        rows = np.zeros((len(lights), 4), np.float32)
        rows[:, :3] = radiosity
        with self._device.current() as context:
            records = GpuVirtualLights(context, lights, self._origin)
            texture = self._sum.render(self._picture, records, context.buffer(rows.tobytes()), silent)
            # Images of the device have row 0 at the bottom, the points of this picture in the order of upload.
            found = read_image(texture)[::-1, :, :3]
        return _from_tiles(found).astype(np.float64)


def _in_tiles(values: Float64) -> Float64:
    """(ROWS, COLUMNS, 3): consecutive points fill a tile, which the shaders look at together."""
    tiles = values.reshape(ROWS // TILE, COLUMNS // TILE, TILE, TILE, 3)
    image: Float64 = tiles.swapaxes(1, 2).reshape(ROWS, COLUMNS, 3)
    return image


def _from_tiles(image: np.ndarray) -> np.ndarray:
    tiles = image.reshape(ROWS // TILE, TILE, COLUMNS // TILE, TILE, 3)
    return tiles.swapaxes(1, 2).reshape(POINTS, 3)
