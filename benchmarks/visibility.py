# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of the virtual light mesh against Cycles beside the milliseconds that each kind of visibility takes.

Error: indirect relative RMSE against one bounce by Cycles, of a single picture and of the mean of some. Milliseconds:
of a single picture, the least of a few; what is kept over frames (octree, baked visibility) is not in them.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Any

from benchmarks.support import open_sample, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import Float32, SceneSnapshot
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh, subdivide_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

SCENES = {"cornell_box": 500, "monkey_box": 1500}
"""How many lights bodies get; the walls' large triangles are halved down to the rest."""
CHOICES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("none", {"visibility": "none"}),
    *((f"octree, {rays}", {"visibility": "octree", "visibility_rays": rays}) for rays in (1, 4, 16)),
    ("octree, 4, unfiltered", {"visibility": "octree", "visibility_rays": 4, "filter": "none"}),
    ("octree, 4, voxels between", {"visibility": "octree", "visibility_rays": 4, "exact_reach": 2}),
    ("baked", {"visibility": "baked"}),
)
SHADOW_SAMPLES = 8
PASSES = ("phase two", "pick lights", "visibility rays", "visibility filter")


@dataclass(frozen=True)
class _Case:
    snapshot: SceneSnapshot
    light_mesh: VirtualLightMesh
    truth: Float32


def main() -> None:
    """Prints a table for each scene."""
    options = _options()
    for name in options.scenes:
        scene = open_sample(name)
        shape = create_light_mesh(scene.snapshot.meshes, SimplifySettings(min(SCENES[name], options.lights))).light_mesh
        light_mesh = subdivide_light_mesh(shape, options.lights)
        with quiet():
            reference = render_reference(options.size, options.size, 1, options.reference_samples)
        case = _Case(scene.snapshot, light_mesh, reference.images["indirect"])
        print(f"{name}, {len(light_mesh)} lights; noise of the reference {reference.noise['indirect']:.2%}")
        with Device() as device:
            rows = [_row(device, case, label, chosen, options) for label, chosen in CHOICES if label in options.kinds]
            columns = ("visibility, rays", "error, 1", f"error, {options.samples}", "blocked", *PASSES, "all, ms")
            print(table(columns, rows))
            print(f"on {device.name}")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--lights", type=int, default=2000)
    parser.add_argument("--runs", type=int, default=3, help="of a single picture")
    parser.add_argument("--kinds", nargs="*", default=[label for label, _ in CHOICES], help="rows of the table")
    parser.add_argument("--reference-samples", type=int, default=4096)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), choices=list(SCENES), metavar="SCENE")
    return parser.parse_args()


def _row(
    device: Device, case: _Case, label: str, chosen: dict[str, Any], options: argparse.Namespace
) -> tuple[str, ...]:
    def frame(samples: int) -> Frame:
        settings = RenderSettings(options.size, options.size, "vlm", chosen, samples, shadow_samples=SHADOW_SAMPLES)
        return device.render(case.snapshot, case.light_mesh, settings)

    def error(frame: Frame) -> str:
        return f"{relative_rmse(frame.images['indirect'], case.truth):.2%}"

    many, single = frame(options.samples), [frame(1) for _ in range(options.runs)]
    least = {name: min(dict(each.timings).get(name, 0.0) for each in single) for name in PASSES}
    counters = many.counters
    cast, blocked = (counters.get(f"visibility_rays{end}", 0.0) for end in ("", "_blocked"))
    share = f"{blocked / cast:.1%}" if cast else ""
    times = [f"{least[name]:.0f}" if least[name] else "" for name in PASSES]
    return label, error(single[0]), error(many), share, *times, f"{sum(least.values()):.0f}"


if __name__ == "__main__":
    main()
