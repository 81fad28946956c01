# SPDX-License-Identifier: GPL-3.0-or-later
"""Seed 000's tables 5.1 to 5.15 on the sample scenes lightwave_room, with the published figures and our own error.

A row has frames per second with everything kept from the frame before (`fps`) and right after the lamp moved
(`moved`), similarity to the default (algorithm 1 with its ratio the right way up), rank value (eq. 5.3), the indirect
error against Cycles with one diffuse bounce and the similarity of the whole picture to it. Pictures are as many times
smaller than the seed's as --divide says; --long is for full size. Published figures are of another machine and room.
A software renderer's frames per second are what its processor time would make if nothing else ran.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.lightwave_published import DEFAULT, FULL, TABLES, Row
from benchmarks.support import open_sample, quiet
from vlm_addon.blender.cycles_reference import Reference, render_reference
from vlm_addon.core.metrics import rank_value, relative_rmse, similarity
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.core.settings import from_mapping
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.images import srgb_from_linear
from vlm_addon.render.technique import technique_by_name
from vlm_addon.terminal import table

SHORT_DIVISOR = 8
REFERENCE_SIZE = (160, 90)
REFERENCE_SAMPLES = 256
ERROR_SAMPLES = 4
STILL_FRAMES = 2
LAMP_STEP_M = 0.05
SHADOW_RESOLUTION = 1024
HEADER = ("", "fps", "moved", "seed's fps", "similar", "seed's", "rank", "seed's", "error", "like Cycles")


class Measured(NamedTuple):
    """fps: with all kept; moved: after the lamp moved. picture: 8 bits. error: indirect. like_cycles: similarity."""

    fps: float
    moved: float
    picture: npt.NDArray[np.uint8]
    error: float
    like_cycles: float


class Bench:
    """Measures each combination of room, technique, settings and size once."""

    def __init__(self, device: Device, divisor: int, with_cycles: bool) -> None:
        self._device = device
        self._with_cycles = with_cycles
        self._divisor = divisor
        self._found: dict[str, Measured] = {}
        self.rooms: set[int] = set()

    def measured(self, row: Row) -> Measured:
        """What a row of a table is about."""
        chosen: object = from_mapping(technique_by_name(row.technique).settings, row.settings, row.label)
        key = repr((row.pots, row.technique, chosen, row.size))
        if key not in self._found:
            self._found[key] = self._measure(row)
        return self._found[key]

    def _measure(self, row: Row) -> Measured:
        self.rooms.add(row.pots)
        scene = room(row.pots)
        lamp = scene.lights[0]
        x, y, z = lamp.position
        moved_scene = replace(scene, lights=(replace(lamp, position=(x + LAMP_STEP_M, y, z)),))
        # Compiles the shaders.
        self._render(scene, row)
        still = [self._render(scene, row) for _ in range(STILL_FRAMES)]
        _, moved = self._render(moved_scene, row)
        error, like_cycles = self._against_cycles(scene, row) if self._with_cycles else (math.nan, math.nan)
        picture = srgb_from_linear(still[0][0].images["combined"])
        return Measured(1.0 / min(seconds for _, seconds in still), 1.0 / moved, picture, error, like_cycles)

    def _against_cycles(self, scene: SceneSnapshot, row: Row) -> tuple[float, float]:
        """Indirect error and similarity of the whole picture."""
        truth = reference(row.pots)
        share = row.size[0] / FULL[0]
        size = (round(share * REFERENCE_SIZE[0]), round(share * REFERENCE_SIZE[1]))
        settings = RenderSettings(*size, row.technique, row.settings, ERROR_SAMPLES, SHADOW_RESOLUTION, ERROR_SAMPLES)
        frame = self._device.render(scene, None, settings)
        indirect = stretched(frame.images["indirect"], REFERENCE_SIZE)
        displayed = srgb_from_linear(stretched(frame.images["combined"], REFERENCE_SIZE))
        return (
            relative_rmse(indirect, truth.images["indirect"]),
            similarity(displayed, srgb_from_linear(truth.images["combined"])),
        )

    def _render(self, scene: SceneSnapshot, row: Row) -> tuple[Frame, float]:
        width, height = (round(side / self._divisor) for side in row.size)
        settings = RenderSettings(width, height, row.technique, row.settings, 1, SHADOW_RESOLUTION, 1)
        started = self._clock()
        frame = self._device.render(scene, None, settings)
        return frame, self._clock() - started

    def _clock(self) -> float:
        """Seconds. A software renderer's are those of all processors together: other programs do not count."""
        return time.process_time() / (os.cpu_count() or 1) if self._device.is_software else time.perf_counter()


@cache
def room(pots: int) -> SceneSnapshot:
    """The room with no, one or ten pots."""
    return open_sample(f"lightwave_room_{pots}" if pots else "lightwave_room").snapshot


@cache
def reference(pots: int) -> Reference:
    """Cycles with one diffuse bounce, at REFERENCE_SIZE."""
    open_sample(f"lightwave_room_{pots}" if pots else "lightwave_room")
    with quiet():
        return render_reference(*REFERENCE_SIZE, 1, REFERENCE_SAMPLES)


def stretched(image: npt.NDArray[np.generic], size: tuple[int, int]) -> npt.NDArray[np.generic]:
    """The picture in another size, each pixel that of its middle (seed 000, 5.1.4: naive sampling)."""
    height, width = image.shape[:2]
    columns = ((np.arange(size[0]) + 0.5) * width / size[0]).astype(int)
    rows = ((np.arange(size[1]) + 0.5) * height / size[1]).astype(int)
    return image[rows[:, None], columns]


def cells(bench: Bench, row: Row) -> tuple[str, ...]:
    """A row as text."""
    found, best = bench.measured(row), bench.measured(replace(DEFAULT, pots=row.pots))
    height, width = best.picture.shape[:2]
    similar = similarity(stretched(found.picture, (width, height)), best.picture)
    rank = rank_value(found.fps, best.fps, similar)
    return (
        row.label,
        f"{found.fps:.2f}",
        f"{found.moved:.2f}",
        said(row.fps, ".0f"),
        f"{similar:.2%}",
        said(row.similar, ".2f", "%"),
        "" if similar == 1.0 else f"{rank:.3f}",
        said(row.rank, ".2f"),
        "" if math.isnan(found.error) else f"{found.error:.1%}",
        "" if math.isnan(found.error) else f"{found.like_cycles:.1%}",
    )


def said(value: float | None, form: str, unit: str = "") -> str:
    """A published figure, nothing where there is none."""
    return "" if value is None else f"{value:{form}}{unit}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Prints all tables, or those of the given numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", help="numbers, such as 5.9")
    parser.add_argument("--divide", type=int, default=SHORT_DIVISOR, help="sides of pictures by this")
    parser.add_argument("--long", action="store_true", help="the seed's sizes: minutes to hours without a GPU")
    parser.add_argument("--no-cycles", action="store_true", help="leave out what is measured against Cycles")
    given = parser.parse_args(arguments)
    divisor = 1 if given.long else given.divide
    with Device() as device:
        clock = "processor time over all processors" if device.is_software else "wall clock"
        print(f"{device.name}; sizes are the seed's divided by {divisor}; frames per second by {clock}")
        bench = Bench(device, divisor, not given.no_cycles)
        for name, rows in TABLES.items():
            if not given.tables or set(given.tables) & set(name.partition(":")[0].split(" and ")):
                print(f"\n{name}\n{table(HEADER, [cells(bench, row) for row in rows])}", flush=True)
    for pots in () if given.no_cycles else sorted(bench.rooms):
        noise = reference(pots).noise
        print(f"noise of the reference, {pots} pots: {noise['indirect']:.1%}, whole picture {noise['combined']:.1%}")


if __name__ == "__main__":
    main()
