# SPDX-License-Identifier: GPL-3.0-or-later
"""Phase two by brute force: milliseconds and evaluations a second against the number of virtual lights.

`./dev bench phase_two` shades one picture of the empty room with its walls cut into ever more lights. Evaluations
count pairs of a light and a pixel that shows a surface. Processor seconds are those of all threads, so that they mean
the same on a busy machine; on a GPU they mean nothing.
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks.support import open_sample
from tests.render.rooms import lights_from_triangles, split
from vlm_addon.core.progress import silent
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.phase_two import PhaseTwoPass
from vlm_addon.render.view import make_view
from vlm_addon.render.virtual_lights import GpuVirtualLights
from vlm_addon.terminal import table

SCENE = "empty_room"
SIZE = (320, 240)
SPLITS = (1, 2, 3, 4)
RUNS = 2
HEADER = ("lights", "wall ms", "processor ms", "M evaluations / s", "M evaluations / processor s")


def main() -> None:
    """Prints the table."""
    snapshot = open_sample(SCENE).snapshot
    assert snapshot.camera is not None
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes])
    with Device() as device, device.current() as context:
        geometry = GpuGeometry(context, snapshot)
        view = make_view(snapshot.camera, *SIZE, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, *SIZE).render(geometry, view, 0)
        shown = int(np.any(read_image(gbuffer.geometric_normal)[..., :3] != 0.0, axis=2).sum())
        phase_two = PhaseTwoPass(context, device.shaders, *SIZE)
        rows = []
        for splits in SPLITS:
            lights = lights_from_triangles(split(corners, splits))
            records = GpuVirtualLights(context, lights, geometry.origin)
            radiosity = context.buffer(np.ones((len(lights), 4), np.float32).tobytes())
            wall, processor = np.inf, np.inf
            for _ in range(RUNS):
                context.finish()
                start = time.perf_counter(), time.process_time()
                phase_two.render(gbuffer, records, radiosity, silent)
                context.finish()
                wall, processor = (
                    min(best, now - then)
                    for best, now, then in zip(
                        (wall, processor), (time.perf_counter(), time.process_time()), start, strict=True
                    )
                )
            millions = 1e-6 * len(lights) * shown
            rows.append(
                (
                    str(len(lights)),
                    f"{1e3 * wall:.0f}",
                    f"{1e3 * processor:.0f}",
                    f"{millions / wall:.1f}",
                    f"{millions / processor:.1f}",
                )
            )
        print(f"{device.name}, {SIZE[0]} x {SIZE[1]}, {shown} pixels show a surface")
    print(table(HEADER, rows))


if __name__ == "__main__":
    main()
