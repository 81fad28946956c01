# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance by cells of a light grid, pixel by pixel, against the sum over the grid's candidates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.pixels import Pixels, expected, radiosity_rows, random_lights
from tests.render.rooms import box_room, mesh_lights
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.progress import silent
from vlm_addon.core.range_grid import RangeGrid, RangeSettings
from vlm_addon.core.scene import Float32, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.light_structures import gpu_grid
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.light_grid import upload
from vlm_addon.render.passes.phase_two_range import RangePhaseTwoPass
from vlm_addon.render.virtual_lights import GpuVirtualLights

HERE = LocalSpace(np.zeros(3), 1.0)
BOUNDS = (np.full(3, -1.0), np.full(3, 1.0))


def by_cells(
    device: Device,
    pixels: Pixels,
    lights: VirtualLightMesh,
    radiosity: Float32,
    grids: list[RangeGrid],
    space: LocalSpace = HERE,
    bounds: tuple[Float64, Float64] = BOUNDS,
) -> Float32:
    """(h, w, 3) of the pass, row 0 at the top. Pixels and lights in `space`, grids and bounds in the world."""
    height, width = pixels.shown.shape
    with device.current() as context:
        render = RangePhaseTwoPass(context, device.shaders, width, height)
        gpu_grids = [gpu_grid(context, grid.frame, grid.half_balls, upload(context, grid.lists)) for grid in grids]
        records = GpuVirtualLights(context, lights, np.zeros(3))
        buffer = context.buffer(radiosity_rows(radiosity))
        found = render.render(pixels.gbuffer(device), records, buffer, gpu_grids, space, bounds, silent)
        return read_image(found)[..., :3]


def candidates_sum(pixels: Pixels, lights: VirtualLightMesh, radiosity: Float32, grids: list[RangeGrid]) -> Float64:
    """(h, w, 3): the sum in float64 over the candidates of each pixel."""
    positions, normals = pixels.flat()
    total = np.zeros((len(positions), 3))
    tags = pixels.tag_ids.reshape(-1)
    for grid in grids:
        offsets, ids = grid.candidates(positions)
        points = np.repeat(np.arange(len(positions)), np.diff(offsets))
        others = (lights.tag_ids[ids] == 0) | (lights.tag_ids[ids] != tags[points])
        points, ids = points[others], ids[others]
        factors = paired_form_factor(positions[points], normals[points], lights.corners[ids])
        np.add.at(total, points, factors[:, None] * radiosity[ids])
    return np.where(pixels.shown[..., None], total.reshape(*pixels.shown.shape, 3), 0.0)


@pytest.mark.parametrize("settings", [RangeSettings(7, 4.0), RangeSettings(12, 2.0, 9), RangeSettings(1, 1.0)])
def test_each_pixel_gets_the_lights_of_its_cell(device: Device, settings: RangeSettings) -> None:
    generator = np.random.default_rng(settings.grid)
    pixels, lights = Pixels(generator), random_lights(generator, 300, 0.1)
    radiosity = generator.uniform(0.0, 10.0, (300, 3)).astype(np.float32)
    lights.dynamic[:] = generator.random(300) < 0.3
    grids = [RangeGrid.bake(lights, BOUNDS, settings, chosen=part) for part in (~lights.dynamic, lights.dynamic)]
    exact = candidates_sum(pixels, lights, radiosity, grids)
    found = by_cells(device, pixels, lights, radiosity, grids)
    # It is not the sum over all lights.
    assert np.abs(exact - expected(pixels, lights, radiosity)).max() > 0.1 * exact.mean()
    off = np.abs(found - exact) > 2e-4 * exact + 2e-5 * exact.max()
    # A pixel within rounding of a face may be in the other cell.
    assert off.any(axis=2).mean() <= 1.0 / pixels.shown.size


def test_pixels_outside_the_grid_get_the_lights_that_reach_them(device: Device) -> None:
    generator = np.random.default_rng(3)
    pixels, lights = Pixels(generator), random_lights(generator, 200, 0.1)
    bounds = (np.full(3, -0.4), np.full(3, 0.5))
    radiosity = generator.uniform(0.0, 10.0, (200, 3)).astype(np.float32)
    grids = [RangeGrid.bake(lights, bounds, RangeSettings(6, 4.0))]
    found, exact = by_cells(device, pixels, lights, radiosity, grids), candidates_sum(pixels, lights, radiosity, grids)
    assert found == pytest.approx(exact, rel=2e-4, abs=2e-5 * exact.max())


def test_a_grid_in_the_world_serves_every_local_space(device: Device) -> None:
    generator = np.random.default_rng(4)
    pixels, lights = Pixels(generator), random_lights(generator, 100, 0.1)
    radiosity = np.ones((100, 3), np.float32)
    space = LocalSpace(np.array([1000.0, -20.0, 5.0]), 0.25)
    moved = replace(lights, vertices=space.unit * lights.vertices + space.origin)
    bounds = (space.unit * BOUNDS[0] + space.origin, space.unit * BOUNDS[1] + space.origin)
    grids = [RangeGrid.bake(moved, bounds, RangeSettings(8, 3.0))]
    here = [RangeGrid.bake(lights, BOUNDS, RangeSettings(8, 3.0))]
    found = by_cells(device, pixels, lights, radiosity, grids, space, bounds)
    off = np.abs(found - by_cells(device, pixels, lights, radiosity, here)) > 1e-4
    assert off.any(axis=2).mean() <= 2.0 / pixels.shown.size


def test_a_range_that_reaches_everything_gives_the_full_sum(device: Device) -> None:
    generator = np.random.default_rng(5)
    pixels, lights = Pixels(generator), mesh_lights(box_room((-1.0, -1.0, -1.0)).meshes)
    radiosity = generator.uniform(0.0, 1.0, (len(lights), 3)).astype(np.float32)
    grids = [RangeGrid.bake(lights, BOUNDS, RangeSettings(5, 100.0))]
    exact = expected(pixels, lights, radiosity)
    assert by_cells(device, pixels, lights, radiosity, grids) == pytest.approx(exact, rel=2e-4, abs=2e-5)


def test_more_lights_than_a_dispatch_holds(device: Device) -> None:
    generator = np.random.default_rng(6)
    pixels, lights = Pixels(generator, (5, 5)), random_lights(generator, 20_000, 0.02)
    radiosity = generator.uniform(0.0, 1.0, (20_000, 3)).astype(np.float32)
    grids = [RangeGrid.bake(lights, BOUNDS, RangeSettings(3, 200.0))]
    exact = expected(pixels, lights, radiosity)
    found = by_cells(device, pixels, lights, radiosity, grids)
    assert found == pytest.approx(exact, rel=2e-4, abs=2e-5 * exact.max())
