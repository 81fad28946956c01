# SPDX-License-Identifier: GPL-3.0-or-later
"""Milliseconds of a frame of the atrium: all lights, lists of grid cells, and clusters within a tolerance.

`./dev bench frame_time [lights …]` prints the thesis's tables 5.1 (all of 20 to 240 lights) and 5.3 (lists of 10 to
120 lights on a grid of 50 cells a side) beside its own figures, and what a tolerance of 1, 2, 5 and 10 % costs beside
the sum over all lights. Few lights are taken at even distances from the light mesh of 1,000; lists are cut from those
of --list-lights lights. A frame is one sample of every pixel; its time is that of all passes but the upload of the
geometry and the building of trees and grids, which later frames do not repeat. Of --runs frames the one with the least
processor time for phase two counts: milliseconds of all threads, which mean the same on a busy machine (on a GPU they
mean nothing).
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.metrics import point_error
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.techniques.vlm import VirtualLightMeshTechnique
from vlm_addon.terminal import table

SCENE = "atrium"
THESIS_SIZE = (1280, 720)
LIGHTS = (1_000, 10_000, 100_000)
TOLERANCES = (0.01, 0.02, 0.05, 0.1)
SHADOW_RESOLUTION = 512
NOT_IN_A_FRAME = ("geometry", "relight", "light grid")
TIMES = ("phase two ms", "(processor)", "frame ms")

ALL_LIGHTS_MS = {
    20: 2.40, 40: 6.25, 60: 11.07, 80: 12.88, 100: 17.15, 120: 21.03, 140: 24.41, 160: 26.63, 180: 30.85, 200: 33.14,
    220: 38.22, 240: 41.37,
}  # fmt: skip
"""Seed 002, table 5.1: a GTX 950, Crytek's Sponza at 1,280 x 720; all lights, by number of lights."""
LIST_MS = {
    10: 12.96, 20: 15.77, 30: 16.54, 40: 27.03, 50: 29.77, 60: 33.57, 70: 51.60, 80: 79.55, 90: 86.09, 100: 89.86,
    110: 96.75, 120: 115.26,
}  # fmt: skip
"""Seed 002, table 5.3: the same, 50 x 50 x 50 cells, by lights of a cell's list."""


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lights", nargs="*", type=int, default=LIGHTS)
    parser.add_argument("--size", default="320x180", help="of the pictures of the last table")
    parser.add_argument("--thesis-size", default="x".join(map(str, THESIS_SIZE)), help="of the first two")
    parser.add_argument("--list-lights", type=int, default=10_000)
    parser.add_argument("--runs", type=int, default=2)
    options = parser.parse_args()
    scene = open_sample(SCENE).snapshot
    with Device() as device:
        frames = Frames(device, scene, options.runs)
        print(f"{device.name}; {platform.processor() or platform.machine()}; {SCENE}")
        size = _size(options.thesis_size)
        print(f"\nAll lights, {size[0]} x {size[1]} (table 5.1)")
        print(all_lights_table(frames, size))
        print(f"\nLists of cells, 50³ cells, {options.list_lights:,} lights, {size[0]} x {size[1]} (table 5.3)")
        print(list_table(frames, size, options.list_lights))
        size = _size(options.size)
        print(f"\nA tolerance against all lights, {size[0]} x {size[1]}")
        print(tolerance_table(frames, size, options.lights))


@dataclass(frozen=True)
class Timed:
    """A frame, and the processor milliseconds of its phase two."""

    frame: Frame
    processor: float

    @property
    def times(self) -> tuple[str, str, str]:
        """Milliseconds of phase two, of processors in it, and of the frame."""
        times = dict(self.frame.timings)
        whole = sum(ms for name, ms in times.items() if name not in NOT_IN_A_FRAME)
        return f"{times['phase two']:,.1f}", f"{self.processor:,.0f}", f"{whole:,.1f}"


@contextmanager
def processor_clock(device: Device) -> Iterator[list[float]]:
    """Fills a list with the processor milliseconds of each phase two in the block."""
    indirect, milliseconds = VirtualLightMeshTechnique.indirect, []

    def clocked(*inputs: object) -> object:
        device.context.finish()
        start = time.process_time()
        result = indirect(*inputs)  # type: ignore[arg-type]
        device.context.finish()
        milliseconds.append(1e3 * (time.process_time() - start))
        return result

    VirtualLightMeshTechnique.indirect = clocked  # type: ignore[method-assign,assignment]
    try:
        yield milliseconds
    finally:
        VirtualLightMeshTechnique.indirect = indirect  # type: ignore[method-assign]


class Frames:
    """Frames of one scene on one device, the fastest of some."""

    def __init__(self, device: Device, scene: SceneSnapshot, runs: int) -> None:
        self.device = device
        self.scene = scene
        self.runs = runs

    def fastest(self, light_mesh: VirtualLightMesh, size: tuple[int, int], **values: object) -> Timed:
        """The fastest frame; the structures that it needs have been built before."""
        settings = RenderSettings(
            *size,
            technique_settings=values,
            samples=1,
            shadow_resolution=SHADOW_RESOLUTION,
            shadow_samples=1,
            buffers=True,
        )
        # Compiles shaders and builds what is kept.
        self.device.render(self.scene, light_mesh, replace(settings, width=16, height=16))
        timed = []
        for _ in range(self.runs):
            with processor_clock(self.device) as milliseconds:
                frame = self.device.render(self.scene, light_mesh, settings)
            timed.append(Timed(frame, sum(milliseconds)))
        return min(timed, key=lambda each: each.processor)

    def lights(self, count: int) -> VirtualLightMesh:
        """The scene simplified to so many lights."""
        return create_light_mesh(self.scene.meshes, SimplifySettings(count, 1)).light_mesh


def all_lights_table(frames: Frames, size: tuple[int, int]) -> str:
    """Table 5.1."""
    source = frames.lights(1000)
    rows = []
    for count, thesis in ALL_LIGHTS_MS.items():
        rows.append((str(count), *frames.fastest(every(source, count), size, lights="all").times, f"{thesis:.2f}"))
    return table(("lights", *TIMES, "thesis, frame ms"), rows)


def list_table(frames: Frames, size: tuple[int, int], count: int) -> str:
    """Table 5.3."""
    source = frames.lights(count)
    rows = []
    for most, thesis in LIST_MS.items():
        found = frames.fastest(source, size, lights="range", grid=50, max_lights=most)
        rows.append((str(most), *found.times, f"{thesis:.2f}"))
    return table(("list", *TIMES, "thesis, frame ms"), rows)


def tolerance_table(frames: Frames, size: tuple[int, int], counts: list[int]) -> str:
    """What tolerances cost, and by how much the picture is off the sum over all lights."""
    rows = []
    for count in counts:
        source = frames.lights(count)
        once = Frames(frames.device, frames.scene, 1)
        exact = once.fastest(source, size, lights="all")
        rows.append((f"{len(source):,}", "all lights", *exact.times, f"{len(source):,}", "-", "-", "-"))
        for tolerance in TOLERANCES:
            found = frames.fastest(source, size, tolerance=tolerance)
            errors = point_errors(found.frame, exact.frame)
            rows.append(
                (
                    f"{len(source):,}",
                    f"{tolerance:.0%}",
                    *found.times,
                    f"{found.frame.counters['evaluated_per_pixel']:,.0f}",
                    f"{exact.processor / found.processor:.1f}",
                    f"{np.quantile(errors, 0.95):.2%}",
                    f"{np.quantile(errors, 0.999):.2%}",
                )
            )
    header = ("lights", "tolerance", *TIMES, "in a tile's lists", "faster", "95th %", "99.9th %")
    return table(header, rows)


def point_errors(frame: Frame, exact: Frame) -> np.ndarray:
    """`point_error` of the irradiance of each pixel that is lit."""
    found, truth = (each.images["irradiance"][..., :3].sum(axis=2, dtype=float) for each in (frame, exact))
    lit = truth > 0.0
    return point_error(found[lit], truth[lit])


def every(light_mesh: VirtualLightMesh, count: int) -> VirtualLightMesh:
    """`count` of the lights, at even distances in their order."""
    rows = np.linspace(0, len(light_mesh) - 1, count).astype(int)
    samples = light_mesh.samples
    counts = np.diff(samples.offsets)[rows]
    offsets = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
    chosen = np.repeat(samples.offsets[rows] - offsets[:-1], counts) + np.arange(offsets[-1])
    return replace(
        light_mesh,
        triangles=light_mesh.triangles[rows],
        **{name: getattr(light_mesh, name)[rows] for name in ("colour", "emission", "strength", "tag_ids", "dynamic")},
        samples=SourceSamples(samples.positions[chosen], samples.normals[chosen], samples.weights[chosen], offsets),
    )


def _size(text: str) -> tuple[int, int]:
    width, height = (int(part) for part in text.split("x"))
    return width, height


if __name__ == "__main__":
    main()
