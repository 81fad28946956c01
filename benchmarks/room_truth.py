# SPDX-License-Identifier: GPL-3.0-or-later
"""empty_room against Cycles with one diffuse bounce: the error of 50, 200 and 2,000 virtual lights.

In a closed convex room nothing occludes, so what remains is the resolution of the light mesh.
"""

from __future__ import annotations

from dataclasses import replace

import bpy

from benchmarks.support import open_sample, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.simplify import create_light_mesh, subdivide_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.terminal import table

SIZE_PX = 64
SAMPLES = 16
REFERENCE_SAMPLES = 2048
LIGHT_COUNTS = (50, 200, 2000)
# Share of the way from the room's middle to its highest corner, per axis, where the lamp hangs.
LAMP_PLACES = {"centre": (0.0, 0.0, 0.0), "near the ceiling": (0.0, 0.0, 0.85), "near a corner": (0.8, 0.8, 0.8)}


def main() -> None:
    """Prints a row for each place of the lamp and each number of lights."""
    rows = []
    for place, share in LAMP_PLACES.items():
        with quiet():
            found = _with_lamp(share)
            reference = render_reference(SIZE_PX, SIZE_PX, 1, REFERENCE_SAMPLES)
        base = create_light_mesh(found.snapshot.meshes).light_mesh
        truth = reference.images
        for count in LIGHT_COUNTS:
            lights = subdivide_light_mesh(base, count)
            settings = RenderSettings(SIZE_PX, SIZE_PX, samples=SAMPLES)
            with Device() as device:
                frame = device.render(found.snapshot, lights, settings)
            rows.append(
                (
                    place,
                    str(len(lights)),
                    f"{relative_rmse(frame.images['indirect'], truth['indirect']):.2%}",
                    f"{relative_rmse(frame.images['combined'][..., :3], truth['combined']):.2%}",
                    f"{reference.noise['indirect']:.2%}",
                    f"{sum(ms for _, ms in frame.timings):.0f}",
                )
            )
    print(table(("lamp", "lights", "indirect error", "total error", "noise of the reference", "ms"), rows))


def _with_lamp(share: tuple[float, float, float]):
    found = open_sample("empty_room")
    low, high = found.snapshot.bounds()
    lamp = next(thing for thing in bpy.context.scene.objects if thing.type == "LIGHT")
    lamp.location = (low + high) / 2 + (high - low) / 2 * share
    return replace(extract(), light_mesh=None)


if __name__ == "__main__":
    main()
