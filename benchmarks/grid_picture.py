# SPDX-License-Identifier: GPL-3.0-or-later
"""The thesis's figure 5.6 drawn again: cells of a light grid at four ranges, beside a tolerance and all lights.

`./dev bench grid_picture` writes docs/light_grid.png. Settings of the thesis (seed 002, 5.2): 10 x 10 x 10 cells, at
most 20 lights in each. The first two rows are its 44 lights, of which a tolerance sums all; the last two are the same
lights, cut into --lights pieces.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.support import ALONE, displayed, open_sample, rgb
from vlm_addon.core.light_grid import FEW_LIGHTS
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.core.simplify import subdivide_light_mesh
from vlm_addon.measure.contact_sheet import error_map, side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

SCENE = "cornell_box"
TARGET = Path("docs/light_grid.png")
RANGES = (1.5, 2.5, 3.5, 4.5)
CELLS, MOST_LIGHTS = 10, 20
TOLERANCE = 0.02
SAMPLES = 4


def main() -> None:
    """Renders the pictures, writes them side by side and prints how far each is off the sum over all lights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=224, help="pixels along a side of each picture")
    parser.add_argument("--lights", type=int, default=2816)
    options = parser.parse_args()
    scene = open_sample(SCENE)
    few = scene.light_mesh
    many = subdivide_light_mesh(few, options.lights)
    with Device() as device:
        of_few, of_many = (_frames(device, scene.snapshot, lights, options.size) for lights in (few, many))
        print(f"{device.name}, {SCENE}, {options.size} x {options.size}")
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "picture.png"
        for label, frames, image in (
            (f"{len(few)} lights", of_few, "combined"),
            ("indirect only", of_few, "indirect"),
            (f"{len(many):,} lights", of_many, "indirect"),
        ):
            pictures += [
                (f"{name}: {label}" if column == 0 else name, displayed(target, rgb(frame.images[image])))
                for column, (name, frame) in enumerate(frames.items())
            ]
    pictures += [(f"error, {name}", error_map(_error(frame, of_many["all"]))) for name, frame in of_many.items()]
    side_by_side(_same_size(pictures), columns=len(of_few)).save(TARGET)
    rows = [
        (f"{len(lights):,}", name, *_figures(frame, frames["all"]))
        for lights, frames in ((few, of_few), (many, of_many))
        for name, frame in frames.items()
    ]
    print(table(("lights", "structure", "of the light", "95th %", "99.9th %", "phase two ms"), rows))
    print(f"picture: {TARGET}")


def _frames(device: Device, scene: SceneSnapshot, lights: VirtualLightMesh, size: int) -> dict[str, Frame]:
    """The frame of each column by its label."""

    most = MOST_LIGHTS if len(lights) < FEW_LIGHTS else 0

    def frame(**values: object) -> Frame:
        settings = RenderSettings(size, size, technique_settings=values, samples=SAMPLES, buffers=True, effects=ALONE)
        return device.render(scene, lights, settings)

    by_range = {f"range {reach:g}": frame(lights="range", grid=CELLS, max_lights=most, range=reach) for reach in RANGES}
    return {**by_range, f"tolerance {TOLERANCE:.0%}": frame(tolerance=TOLERANCE), "all": frame(lights="all")}


def _error(frame: Frame, exact: Frame) -> np.ndarray:
    """(h, w) |x - r| / max(r, a tenth of the mean r) of the irradiance."""
    found, truth = (each.images["irradiance"][..., :3].sum(axis=2, dtype=float) for each in (frame, exact))
    error: np.ndarray = np.abs(found - truth) / np.maximum(truth, 0.1 * truth[truth > 0.0].mean())
    return error


def _figures(frame: Frame, exact: Frame) -> tuple[str, ...]:
    truth = exact.images["irradiance"]
    share = frame.images["irradiance"].sum() / truth.sum()
    errors = _error(frame, exact)[truth[..., :3].sum(axis=2) > 0.0]
    percentiles = (f"{np.quantile(errors, q):.2%}" for q in (0.95, 0.999))
    return f"{share:.1%}", *percentiles, f"{dict(frame.timings)['phase two']:,.0f}"


def _same_size(pictures: list[tuple[str, Image.Image]]) -> list[tuple[str, Image.Image]]:
    size = pictures[0][1].size
    return [(label, picture.resize(size, Image.Resampling.NEAREST)) for label, picture in pictures]


if __name__ == "__main__":
    main()
