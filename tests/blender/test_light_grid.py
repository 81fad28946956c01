# SPDX-License-Identifier: GPL-3.0-or-later
"""Light grids of the sample scenes: the lists are those of brute force, on the processor and on the device."""

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from vlm_addon.blender.light_mesh_io import extract  # noqa: E402
from vlm_addon.core.active_hemisphere import overlaps  # noqa: E402
from vlm_addon.core.light_grid import GridSettings, LightGrid  # noqa: E402
from vlm_addon.core.light_grid_loss import lost_irradiance  # noqa: E402
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.passes.light_grid import LightGridPass  # noqa: E402

FOLDER = Path(__file__).resolve().parents[2] / "sample_blends"
RANGES = (0.5, 1.0, 2.0, 4.0, 8.0)


def opened(name):
    """The extracted scene of a committed file."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{name}.blend"))
    return extract()


def reached(grid, cells):
    """(cells, lights) bool: each of `cells` against every light."""
    n, edges, axes = grid.frame.cells_per_axis, grid.frame.edges, np.arange(3)
    rows = []
    for cell in cells:
        place = np.array([cell % n, cell // n % n, cell // n**2])
        rows.append(overlaps(grid.half_balls, edges[axes, place][:, None], edges[axes, place + 1][:, None]))
    return np.array(rows)


def listed(grid, cells):
    table = np.zeros((len(cells), grid.light_count), bool)
    for row, cell in enumerate(cells):
        table[row, grid.lists.light_ids[grid.lists.offsets[cell] : grid.lists.offsets[cell + 1]]] = True
    return table


def check(light_mesh, bounds, grids, cells_of):
    with Device() as device, device.current() as context:
        builder = LightGridPass(context, device.shaders)
        for size in grids:
            for reach in RANGES:
                grid = LightGrid.bake(light_mesh, bounds, GridSettings(size, reach))
                cells = cells_of(size)
                assert np.array_equal(listed(grid, cells), reached(grid, cells))
                on_device = builder.build_lists(grid.half_balls, grid.frame.edges)
                assert np.array_equal(on_device.offsets, grid.lists.offsets)
                assert np.array_equal(on_device.light_ids, grid.lists.light_ids)


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


def test_a_range_loses_light_and_a_long_one_does_not():
    scene = opened("cornell_box")
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in scene.snapshot.meshes])[::20]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    points = corners.mean(axis=1)[normals.any(axis=1)]
    normals = normals[normals.any(axis=1)]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shares = [
        lost_irradiance(
            LightGrid.bake(scene.light_mesh, scene.snapshot.bounds(), GridSettings(20, reach)),
            scene.light_mesh,
            np.ones((44, 3)),
            points,
            normals,
        ).share
        for reach in (1.5, 2.5, 4.5, 20.0)
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 1e-3
    assert shares[-1] < 1e-12
