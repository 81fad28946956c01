# SPDX-License-Identifier: GPL-3.0-or-later
"""Light grids of the sample scenes: the lists are those of brute force, on the processor and on the device."""

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from vlm_addon.blender.extraction.light_mesh_io import extract  # noqa: E402
from vlm_addon.core.array_codec import content_hash  # noqa: E402
from vlm_addon.core.light_grid import RANGE, TOLERANCE, GridSettings, LightGrid  # noqa: E402
from vlm_addon.core.light_grid_error import grid_error  # noqa: E402
from vlm_addon.core.range_grid import RangeGrid, RangeSettings  # noqa: E402
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh  # noqa: E402
from vlm_addon.core.surface_points import random_surface_points  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.passes.light_grid import LightGridPass  # noqa: E402

FOLDER = Path(__file__).resolve().parents[2] / "sample_blends"
RANGES = (0.5, 1.0, 2.0, 4.0, 8.0)


def opened(name):
    """The extracted scene of a committed file."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{name}.blend"))
    return extract()


def check(light_mesh, bounds, grids, cells_of):
    """For each grid size and range: the lists are those of brute force, and the same on both machines."""
    with Device() as device, device.current() as context:
        builder = LightGridPass(context, device.shaders)
        for size in grids:
            for reach in RANGES:
                grid = RangeGrid.bake(light_mesh, bounds, RangeSettings(size, reach))
                cells = cells_of(size)
                offsets, ids = grid.lists.cell_lists(cells)
                for row, cell in enumerate(cells):
                    found = ids[offsets[row] : offsets[row + 1]]
                    assert np.array_equal(found, np.flatnonzero(grid.reaching(cell)))
                on_device = builder.build(grid.half_balls, grid.frame.edges).read()
                assert content_hash(on_device) == content_hash(grid.lists)


def test_cornell_box():
    scene = opened("cornell_box")
    assert len(scene.light_mesh) == 44
    check(scene.light_mesh, scene.snapshot.bounds(), range(1, 13), lambda size: np.arange(size**3))


@pytest.mark.full
@pytest.mark.parametrize("lights", [1000, 20_000])
def test_atrium(lights):
    snapshot = opened("atrium").snapshot
    light_mesh = create_light_mesh(snapshot.meshes, SimplifySettings(lights, 1)).light_mesh
    rng = np.random.default_rng(0)
    check(light_mesh, snapshot.bounds(), (1, 2, 5, 12, 33), lambda size: rng.integers(0, size**3, 100))


def test_a_range_loses_light_and_a_long_one_or_a_tolerance_does_not():
    scene = opened("cornell_box")
    points = random_surface_points(scene.snapshot.meshes, 150)
    radiosity = scene.light_mesh.nominal_radiosity

    def error(**settings):
        grid = LightGrid.bake(scene.light_mesh, scene.snapshot.bounds(), GridSettings(**settings))
        return grid_error(grid, scene.light_mesh, radiosity, points)

    shares = [error(mode=RANGE, grid=20, range=reach).share_lost for reach in (1.5, 2.5, 4.5, 20.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 1e-3
    assert abs(shares[-1]) < 1e-12
    assert error(mode=TOLERANCE, tolerance=0.02).percentiles()["95 %"] < 0.02
