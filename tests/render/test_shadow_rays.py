# SPDX-License-Identifier: GPL-3.0-or-later
"""Picked lights and rays to them against brute force: every light, every source sample, every triangle in the way."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.render.occluded_room import occluded_sum, room, surface_pixels, wall_lights
from tests.render.pixels import Pixels, radiosity_rows
from tests.render.rooms import lights_from_triangles, quad
from tests.render.test_phase_two_clustered import HERE, lit_trees
from vlm_addon.core.errors import DeviceError
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.progress import silent
from vlm_addon.core.range_grid import RangeGrid, RangeSettings
from vlm_addon.core.scene import Float32, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.kept import Kept
from vlm_addon.render.light_forest import GpuLightForest, make_forest
from vlm_addon.render.light_points import GpuLightPoints
from vlm_addon.render.light_structures import gpu_grid
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.light_grid import upload
from vlm_addon.render.passes.light_picks import LightPicks
from vlm_addon.render.passes.phase_two import PhaseTwoPass
from vlm_addon.render.passes.phase_two_clustered import ClusteredPhaseTwoPass
from vlm_addon.render.passes.phase_two_range import RangePhaseTwoPass
from vlm_addon.render.passes.pick_points import PickPointsPass
from vlm_addon.render.passes.shadow_rays import ShadowRayPass
from vlm_addon.render.scene_octree import scene_octree
from vlm_addon.render.virtual_lights import GpuVirtualLights

SIZE = (20, 12)
ORIGIN = np.zeros(3)
BOUNDS = (np.full(3, -1.0), np.full(3, 1.0))
RAYS, SAMPLES = 16, 24
ALL, CLUSTERS, CELLS = "all", "clusters", "cells"


@dataclass(frozen=True)
class Found:
    """Of each of some samples: (s, h, w, 3) W/m² that gets there of what was picked, and all of it; (h, w, 3) the sum
    over all lights; rays cast and blocked."""

    shadowed: Float32
    unshadowed: Float32
    irradiance: Float32
    counters: dict[str, float]


def cast(
    device: Device,
    snapshot: SceneSnapshot,
    pixels: Pixels,
    lights: VirtualLightMesh,
    radiosity: Float32,
    rays: int,
    samples: int,
    mode: str = ALL,
    exact_reach: int = 64,
) -> Found:
    height, width = pixels.shown.shape
    with device.current() as context:
        gbuffer, records = pixels.gbuffer(device), GpuVirtualLights(context, lights, ORIGIN)
        buffer, points = context.buffer(radiosity_rows(radiosity)), GpuLightPoints(context, lights, ORIGIN)
        octree = scene_octree(context, device.shaders, Kept(), snapshot, 64)
        picks = LightPicks(context, width, height, rays)
        shadow_rays = ShadowRayPass(context, device.shaders, width, height)
        forest, render, pick = None, None, None
        if mode == CELLS:
            grid = RangeGrid.bake(lights, BOUNDS, RangeSettings(4, 50.0))
            grids = [gpu_grid(context, grid.frame, grid.half_balls, upload(context, grid.lists))]
            by_cells = RangePhaseTwoPass(context, device.shaders, width, height)
            inputs = (gbuffer, records, buffer, grids, HERE, BOUNDS, silent)
            render, pick = by_cells.render, by_cells.pick
        elif mode == CLUSTERS:
            forest = GpuLightForest(context, make_forest(lit_trees(lights, radiosity, 0.1), HERE, len(lights)))
            clustered = ClusteredPhaseTwoPass(context, device.shaders, width, height)
            inputs = (gbuffer, records, buffer, forest, silent)
            render, pick = clustered.render, clustered.pick
        else:
            full = PhaseTwoPass(context, device.shaders, width, height)
            inputs = (gbuffer, records, buffer, silent)
            render, pick = full.render, full.pick
        irradiance = render(*inputs)
        found = []
        for picks.sample_index in range(samples):
            pick(picks, *inputs)
            PickPointsPass(context, device.shaders).render(picks, gbuffer, records, buffer, points, forest)
            result = shadow_rays.render(picks, gbuffer, irradiance, buffer, points, octree, HERE, exact_reach, silent)
            found.append([read_image(texture)[..., :3] for texture in (result.shadowed, result.unshadowed)])
        shadowed, unshadowed = (np.stack(images) for images in zip(*found, strict=True))
        return Found(shadowed, unshadowed, read_image(irradiance)[..., :3], shadow_rays.counters())


Scene = tuple[SceneSnapshot, Pixels, VirtualLightMesh, Float32]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A room with a plate, pixels on all of it, 192 lights of even colour but different brightness."""
    snapshot, lights = room(), wall_lights(2)
    radiosity = np.random.default_rng(1).uniform(0.2, 2.0, (len(lights), 1)).astype(np.float32)
    return snapshot, surface_pixels(snapshot, SIZE), lights, np.repeat(radiosity, 3, axis=1)


@pytest.mark.parametrize("mode", [ALL, CELLS, CLUSTERS])
def test_the_mean_of_many_samples_is_brute_force(device: Device, scene: Scene, mode: str) -> None:
    snapshot, pixels, lights, radiosity = scene
    expected, whole = occluded_sum(snapshot, pixels, lights, radiosity)
    found = cast(device, snapshot, pixels, lights, radiosity, RAYS, SAMPLES, mode)
    assert found.unshadowed.mean(axis=0) == pytest.approx(found.irradiance, rel=1e-3)
    # Something does stand in the way.
    seen = expected / whole
    assert seen.mean() < 0.85
    error = (found.shadowed.mean(axis=0) - expected) / whole
    if mode == CLUSTERS:
        # Which also bring what their form factors are off by.
        assert np.abs(error).mean() < 0.02
        return
    # Evenly spread picks are not worse than independent ones, whose noise is a binomial distribution's.
    noise = np.sqrt(np.maximum(seen * (1.0 - seen), 0.0) / (RAYS * SAMPLES))
    assert np.sqrt((error**2).mean()) < np.sqrt((noise**2).mean())
    assert abs(error.mean()) < 3.0 * np.sqrt((noise**2).mean() / error[..., 0].size)


def test_colours_are_occluded_each_by_its_own_lights(device: Device, scene: Scene) -> None:
    snapshot, pixels, lights, _ = scene
    radiosity = np.random.default_rng(2).uniform(0.0, 2.0, (len(lights), 3)).astype(np.float32)
    expected, whole = occluded_sum(snapshot, pixels, lights, radiosity)
    found = cast(device, snapshot, pixels, lights, radiosity, 16, 32)
    error = np.abs(found.shadowed.mean(axis=0) - expected) / whole.mean()
    assert error.mean() < 0.01


def test_noise_falls_at_least_with_the_root_of_the_rays(device: Device, scene: Scene) -> None:
    snapshot, pixels, lights, radiosity = scene
    noise = {}
    for rays in (1, 4, 16):
        found = cast(device, snapshot, pixels, lights, radiosity, rays, 24)
        noise[rays] = np.sqrt((found.shadowed / found.irradiance).var(axis=0).mean())
    assert noise[4] <= 0.55 * noise[1]
    assert noise[16] <= 0.55 * noise[4]


@pytest.mark.parametrize("mode", [ALL, CELLS, CLUSTERS])
def test_an_empty_room_blocks_no_ray(device: Device, scene: Scene, mode: str) -> None:
    snapshot, (_, _, lights, radiosity) = room(False), scene
    pixels = surface_pixels(snapshot, SIZE)
    found = cast(device, snapshot, pixels, lights, radiosity, 4, 4, mode)
    assert found.counters["visibility_rays"] > 0.99 * 4 * 4 * pixels.shown.size
    assert found.counters["visibility_rays_blocked"] == 0
    np.testing.assert_array_equal(found.shadowed, found.unshadowed)


def test_a_wall_between_lets_nothing_through(device: Device, scene: Scene) -> None:
    """Pixels on the dark side of a sheet that cuts the room in two; lights on the walls of the other half."""
    _, _, lights, radiosity = scene
    sheet = (quad((0, -1, -1), (0, 2, 0), (0, 0, 2)), quad((0, -1, -1), (0, 0, 2), (0, 2, 0)))
    snapshot = SceneSnapshot("two rooms", (*room(False).meshes, *sheet))
    pixels = surface_pixels(snapshot, SIZE)
    pixels.shown = pixels.positions[..., 0] < -0.01
    lit = np.where(lights.samples.positions[::4, :1] > 0.0, radiosity, 0.0).astype(np.float32)
    for exact_reach in (2, 64):
        found = cast(device, snapshot, pixels, lights, lit, 4, 4, ALL, exact_reach)
        assert found.irradiance[pixels.shown].min() > 0.0
        assert found.shadowed.max() == 0.0


def test_dark_and_broken_light_and_empty_pixels_are_safe(device: Device, scene: Scene) -> None:
    snapshot, pixels, lights, radiosity = scene
    bare = Pixels(np.random.default_rng(0), SIZE)
    bare.positions, bare.normals, bare.tag_ids = pixels.positions, pixels.normals, pixels.tag_ids
    dark = cast(device, snapshot, bare, lights, np.zeros_like(radiosity), 4, 1)
    assert dark.counters["visibility_rays"] == 0
    assert not dark.unshadowed.any()
    broken = radiosity.copy()
    broken[7] = np.nan, np.inf, 1e38
    found = cast(device, snapshot, bare, lights, broken, 4, 1)
    assert not found.unshadowed[:, ~bare.shown].any()


def test_lights_without_source_samples_count_neither_way(device: Device, scene: Scene) -> None:
    snapshot, pixels, lights, radiosity = scene
    bare = lights_from_triangles(lights.corners)
    none = SourceSamples(
        np.zeros((0, 3)), np.zeros((0, 3), np.float32), np.zeros(0, np.float32), 0 * bare.samples.offsets
    )
    found = cast(device, snapshot, pixels, replace(bare, samples=none), radiosity, 4, 1)
    assert not found.unshadowed.any()
    assert found.counters["visibility_rays"] == 0


def test_more_rays_than_a_block_holds_are_refused(device: Device) -> None:
    with device.current() as context:
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        with pytest.raises(DeviceError, match="fewer rays"):
            LightPicks(context, 1 << 14, limit // (64 << 14) + 1, 16)
