# SPDX-License-Identifier: GPL-3.0-or-later
"""What the plan of effects saves: frames with the plan beside frames in which all that is enabled runs anew.

`./dev bench effects` prints a row for each sample scene and for one without any light: milliseconds by the clock of a
whole frame, from the scene's arrays to the picture's, each the median of --frames frames, all kinds in turns. "first":
with the plan on a device that has seen nothing. "still": with the plan, nothing having changed since the frame before.
"everything": all effects that are enabled by default run, and nothing of earlier frames is used. Shaders are compiled
before the first measured frame. "differs": greatest difference of a pixel between both pictures in steps of an 8-bit
display. Below the table, what each plan left out, and why.

--glossy gives every surface a specular layer of that roughness, which our sample scenes do not have, so that
reflections are called for.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.effects import SKIP
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import PRINCIPLED, Float32, SceneSnapshot
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

SCENES = ("empty_room", "cornell_box", "monkey_box", "lightwave_room", "dancer", "hard_cases", "atrium")
NO_LIGHT = "empty_room, dark"
STEPS = 255.0


@dataclass(frozen=True)
class Costs:
    """Milliseconds of a frame, and the frames that were measured last."""

    first: float
    still: float
    everything: float
    planned: Frame
    complete: Frame


def measured(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, settings: RenderSettings, frames: int) -> Costs:
    """Medians over `frames` frames of each kind."""
    everything = replace(settings, economical=False)
    with Device() as device:
        last = [device.render(snapshot, light_mesh, wanted) for wanted in (settings, everything)]
        found: dict[str, list[float]] = {"first": [], "still": [], "everything": []}
        for _ in range(frames):
            device.forget()
            for kind, wanted in (("first", settings), ("still", settings), ("everything", everything)):
                started = time.perf_counter()
                last[wanted is everything] = device.render(snapshot, light_mesh, wanted)
                found[kind].append(1000.0 * (time.perf_counter() - started))
    medians = {name: float(np.median(values)) for name, values in found.items()}
    return Costs(medians["first"], medians["still"], medians["everything"], *last)


def scene_of(name: str, lights: int, roughness: float | None) -> tuple[SceneSnapshot, VirtualLightMesh]:
    """A sample scene and its light mesh; one of `lights` is made where it has none."""
    found = open_sample(name.partition(",")[0])
    snapshot, light_mesh = found.snapshot, found.light_mesh
    if light_mesh is None:
        light_mesh = create_light_mesh(snapshot.meshes, SimplifySettings(target_triangles=lights)).light_mesh
    if name == NO_LIGHT:
        dark = tuple(replace(lamp, power=(0.0, 0.0, 0.0)) for lamp in snapshot.lights)
        snapshot = replace(snapshot, lights=dark)
    if roughness is not None:
        glossy = tuple(replace(each, model=PRINCIPLED, roughness=roughness) for each in snapshot.materials)
        snapshot = replace(snapshot, materials=glossy)
    return snapshot, light_mesh


def steps(planned: Float32, complete: Float32) -> float:
    """Greatest difference of a pixel in steps of an 8-bit display, the brightest hundredth being white."""
    scale = max(float(np.quantile(complete, 0.99)), 1e-6)
    shown = [np.clip(image / scale, 0.0, 1.0) ** (1.0 / 2.4) for image in (planned, complete)]
    return STEPS * float(np.abs(shown[0] - shown[1]).max())


def rows(arguments: argparse.Namespace) -> None:
    """Prints the table and the reasons."""
    width, height = arguments.size
    settings = RenderSettings(width, height, samples=arguments.samples)
    lines, reasons = [], []
    for name in arguments.scenes:
        snapshot, light_mesh = scene_of(name, arguments.lights, arguments.glossy)
        costs = measured(snapshot, light_mesh, settings, arguments.frames)
        images = [frame.images["combined"][..., :3] for frame in (costs.planned, costs.complete)]
        lines.append(
            (
                name,
                f"{costs.first:.0f}",
                f"{costs.still:.0f}",
                f"{costs.everything:.0f}",
                f"{costs.everything / costs.first:.2f}",
                f"{costs.everything / costs.still:.2f}",
                f"{steps(images[0], images[1]):.2f}",
            )
        )
        skipped = [f"  {each}" for each in costs.planned.plan.effects if each.action == SKIP]
        passes = ", ".join(name for name, _ in costs.planned.timings)
        reasons.append("\n".join([f"{name}: passes {passes}", *skipped]))
    print(f"{costs.planned.device}, {width} x {height} pixels, {arguments.samples} samples, {costs.planned.timer}")
    header = ("scene", "first ms", "still ms", "everything ms", "first gains", "still gains", "differs")
    print(table(header, lines))
    print("\n".join(reasons))


def main(argv: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=[*SCENES, NO_LIGHT])
    parser.add_argument("--size", nargs=2, type=int, default=(160, 120), metavar=("W", "H"))
    parser.add_argument("--samples", type=int, default=RenderSettings.samples)
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--lights", type=int, default=500, help="of scenes without a light mesh")
    parser.add_argument("--glossy", type=float, metavar="ROUGHNESS")
    rows(parser.parse_args(argv))


if __name__ == "__main__":
    main()
