# SPDX-License-Identifier: GPL-3.0-or-later
"""What greatest lists and ranges of the thesis's light grid lose on the atrium, and what their limit costs to build.

`./dev bench light_grid_overflow [lights] [--grid n] [--ranges r …] [--max-lights k …] [--points p]`: irradiance under
even light at random points of the surface, against the sum over all lights.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

from benchmarks.support import open_sample
from vlm_addon.core.block_lists import build_block_lists
from vlm_addon.core.grid_frame import make_frame
from vlm_addon.core.light_grid import RANGE, GridSettings, LightGrid
from vlm_addon.core.light_grid_error import grid_error
from vlm_addon.core.range_grid import RangeGrid, RangeSettings, light_shapes
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.surface_points import random_surface_points
from vlm_addon.terminal import table

SCENE = "atrium"
LIGHTS, GRID, POINTS = 10_000, 50, 200
RANGES, MAX_LIGHTS = (2.0, 4.0, 8.0, 16.0), (30, 120, 480, 0)

HEADER = (
    "range",
    "greatest list",
    "cells that overflow",
    "entries dropped",
    "lights dropped",
    "lost: out of range",
    "lost: overflow",
    "median point error",
    "build s",
    "limit s",
    "lists MB",
    "fixed MB",
)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lights", nargs="?", type=int, default=LIGHTS)
    parser.add_argument("--grid", type=int, default=GRID)
    parser.add_argument("--ranges", nargs="+", type=float, default=RANGES)
    parser.add_argument("--max-lights", nargs="+", type=int, default=MAX_LIGHTS)
    parser.add_argument("--points", type=int, default=POINTS)
    options = parser.parse_args()
    snapshot = open_sample(SCENE).snapshot
    light_mesh = create_light_mesh(snapshot.meshes, SimplifySettings(options.lights, 1)).light_mesh
    points = random_surface_points(snapshot.meshes, options.points)
    bounds = snapshot.bounds()
    frame = make_frame(bounds, options.grid)
    whole = LightGrid.bake(light_mesh, bounds, GridSettings(grid=1, range=0.0, mode=RANGE))
    rows = []
    for reach in options.ranges:
        started = time.perf_counter()
        shapes = light_shapes(light_mesh, frame, reach)
        lists = build_block_lists(shapes.half_balls, frame.edges)
        built = time.perf_counter() - started
        for most in options.max_lights:
            settings = GridSettings(options.grid, reach, most, RANGE)
            started = time.perf_counter()
            grid = RangeGrid.from_lists(RangeSettings(options.grid, reach, most), frame, shapes, lists)
            limited = time.perf_counter() - started
            face = replace(whole, settings=settings, static=grid, dynamic=None)
            error = grid_error(face, light_mesh, light_mesh.nominal_radiosity, points)
            full = grid.occupancy
            rows.append(
                (
                    f"{reach:g}",
                    f"{most:,}" if most else f"any ({full.fullest:,})",
                    f"{len(full.overflowing_cells) / full.cells:.0%}",
                    f"{full.dropped_entries / max(full.dropped_entries + full.entries, 1):.0%}",
                    f"{len(full.dropped_lights):,}",
                    f"{error.share_out_of_range:.1%}",
                    f"{error.share_overflowed:.1%}",
                    f"{error.percentiles()['median']:.1%}",
                    f"{built:.2f}",
                    f"{limited:.2f}",
                    f"{1e-6 * grid.lists.nbytes:.1f}",
                    f"{4e-6 * options.grid**3 * (most or full.fullest):.1f}",
                )
            )
    print(f"{SCENE}, {len(light_mesh):,} lights, {options.grid}³ cells, {options.points} points")
    print(table(HEADER, rows))


if __name__ == "__main__":
    main()
