# SPDX-License-Identifier: GPL-3.0-or-later
"""Building the light grid of the atrium: the thesis's brute force against ours, on the device and on the processor.

`./dev bench light_grid [lights …] [--grid n …] [--range r]` prints a table like the thesis's table 5.2. All three build
the same lists, which is checked. Where brute force would take more than `--tests` tests, it builds every nth group of
64 cells, spread over the grid, and its time is multiplied by n. Seconds are wall clock to the end of all work;
`processor` is the ratio of the times of all threads, which means the same on a busy machine (on a GPU it means
nothing). `fixed MB` is the thesis's layout of the same lists: for every cell as many slots as the fullest needs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.active_hemisphere import HalfBalls
from vlm_addon.core.array_codec import content_hash
from vlm_addon.core.block_lists import BlockLists, build_block_lists
from vlm_addon.core.grid_frame import make_frame
from vlm_addon.core.range_grid import light_shapes
from vlm_addon.core.scene import Float32
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.passes.light_grid import MOST_LIGHTS_PER_PART, LightGridPass, half_ball_records
from vlm_addon.render.prefix_sum import INVOCATIONS
from vlm_addon.render.shader_library import set_uniforms
from vlm_addon.terminal import table

BRUTE_FORCE = "../benchmarks/rivals/light_grid_brute_force.comp"
SCENE = "atrium"
RANGE = 4.0
LIGHTS, GRIDS = (10_000, 100_000), tuple(range(10, 101, 10))
MOST_TESTS = 200_000_000
PARTS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
# A dispatch of so many tests ends within some seconds on two cores.
TESTS_PER_DISPATCH = 400_000_000

THESIS_MS = {
    10_000: {10: 1.18, 20: 9.82, 30: 33.73, 40: 80.24, 50: 155.63, 60: 269.67, 70: 428.74, 80: 638.51, 90: 908.59,
             100: 1247.95},
    100_000: {10: 12.56, 20: 99.38, 30: 337.15, 40: 800.26, 50: 1560.68, 60: 2699.22, 70: 4281.91, 80: 6389.94,
              90: 9109.06, 100: 12494.19},
}  # fmt: skip
"""Seed 002, table 5.2: a GTX 950 and Crytek's Sponza, its range and its greatest list not stated."""

HEADER = (
    "lights, grid",
    "brute force on 1 cell in",
    "brute force s",
    "shaders s",
    "times faster",
    "processor",
    "numpy s",
    "lights a cell",
    "fullest",
    "lists MB",
    "fixed MB",
    "times smaller",
    "thesis s",
)


@dataclass(frozen=True)
class Timed:
    """Milliseconds of wall clock and of all threads, and what was made."""

    wall: float
    processor: float
    result: Any


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lights", nargs="*", type=int, default=LIGHTS)
    parser.add_argument("--grid", nargs="+", type=int, default=GRIDS)
    parser.add_argument("--range", type=float, default=RANGE)
    parser.add_argument("--tests", type=float, default=MOST_TESTS, help="most tests that brute force may take")
    options = parser.parse_args()
    snapshot = open_sample(SCENE).snapshot
    rows = []
    with Device() as device, device.current():
        for lights in options.lights:
            light_mesh = create_light_mesh(snapshot.meshes, SimplifySettings(lights, 1)).light_mesh
            for cells in options.grid:
                frame = make_frame(snapshot.bounds(), cells)
                half_balls = light_shapes(light_mesh, frame, options.range).half_balls
                thesis_ms = THESIS_MS.get(lights, {}).get(cells)
                rows.append(row(device, half_balls, frame.edges, options.tests, thesis_ms))
        print(f"{device.name}, {SCENE}, range {options.range:g}")
    print(table(HEADER, rows))


def row(
    device: Device, half_balls: HalfBalls, edges: Float32, most_tests: float, thesis_ms: float | None
) -> tuple[str, ...]:
    """One line of the table."""
    lights, cells = len(half_balls), edges.shape[1] - 1
    builder = LightGridPass(device.context, device.shaders)
    # Once before it is timed: the first run compiles shaders.
    builder.build(half_balls.take(slice(0, 10)), edges[:, ::cells])
    shaders = timed(device, lambda: builder.build(half_balls, edges))
    numpy_path = timed(device, lambda: build_block_lists(half_balls, edges))
    lists: BlockLists = numpy_path.result
    counts = lists.cell_counts()
    fullest = int(counts.max())
    part = next((part for part in PARTS if cells**3 * lights / part <= most_tests), PARTS[-1])
    brute = timed(device, lambda: brute_force(device, half_balls, edges, fullest, part))
    require_same(lists, shaders.result.read(), brute.result, part)
    fixed = 4 * cells**3 * fullest
    return (
        f"{lights:,}, {cells}³",
        f"{part}",
        seconds(part * brute.wall),
        seconds(shaders.wall),
        f"{part * brute.wall / shaders.wall:,.0f}",
        f"{part * brute.processor / shaders.processor:,.0f}",
        seconds(numpy_path.wall),
        f"{counts.mean():.1f}",
        f"{fullest:,}",
        f"{1e-6 * lists.nbytes:.1f}",
        f"{1e-6 * fixed:.1f}",
        f"{fixed / lists.nbytes:.1f}",
        seconds(thesis_ms) if thesis_ms else "",
    )


def seconds(milliseconds: float) -> str:
    """With three digits or up to the whole second."""
    value = 1e-3 * milliseconds
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


def timed(device: Device, work: Callable[[], Any]) -> Timed:
    """Runs `work` once."""
    device.context.finish()
    wall, processor = time.perf_counter(), time.process_time()
    result = work()
    device.context.finish()
    return Timed(1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - processor), result)


def brute_force(device: Device, half_balls: HalfBalls, edges: Float32, max_lights: int, part: int) -> Any:
    """(cells, max_lights) uint32 lists of one in `part` groups of cells, by the thesis's shader."""
    context = device.context
    shader = device.shaders.compute(BRUTE_FORCE, {"GROUP_SIZE": INVOCATIONS})
    cells_per_axis = edges.shape[1] - 1
    groups = -(-(cells_per_axis**3) // (INVOCATIONS * part))
    records = context.buffer(half_ball_records(half_balls).tobytes())
    faces = context.buffer(edges.tobytes())
    lists = context.buffer(reserve=4 * groups * INVOCATIONS * max_lights)
    counts = context.buffer(reserve=4 * groups * INVOCATIONS)
    for binding, buffer in enumerate((records, faces, lists, counts)):
        buffer.bind_to_storage_buffer(binding)
    values = {"cells_per_axis": cells_per_axis, "light_count": len(half_balls), "max_lights": max_lights}
    chunk = max(1, TESTS_PER_DISPATCH // (INVOCATIONS * MOST_LIGHTS_PER_PART))
    for first_light in range(0, len(half_balls), MOST_LIGHTS_PER_PART):
        end_light = min(first_light + MOST_LIGHTS_PER_PART, len(half_balls))
        values |= {"first_light": first_light, "end_light": end_light}
        for first in range(0, groups, chunk):
            set_uniforms(shader, {**values, "group_step": part, "first_group": first})
            shader.run(min(chunk, groups - first))
            context.finish()
    return lists


def require_same(lists: BlockLists, by_shaders: BlockLists, brute_buffer: Any, part: int) -> None:
    """Stops the benchmark where two ways differ."""
    counts = lists.cell_counts()
    fullest = int(counts.max())
    found = np.frombuffer(brute_buffer.read(), np.uint32).reshape(-1, fullest)
    slots = np.arange(len(found))
    cells = slots // INVOCATIONS * INVOCATIONS * part + slots % INVOCATIONS
    found, cells = found[cells < len(counts)], cells[cells < len(counts)]
    filled = np.arange(fullest) < counts[cells][:, None]
    expected = lists.cell_lists(cells)[1]
    same = content_hash(lists) == content_hash(by_shaders)
    if not (same and np.array_equal(found[filled], expected) and (found[~filled] > lists.light_ids.max()).all()):
        raise SystemExit("the ways to build a grid differ")


if __name__ == "__main__":
    main()
