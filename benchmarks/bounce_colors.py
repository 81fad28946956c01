# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 5.5 of seed 002 again: the red wall of cornell_box bounces blue, or five times as strong, or both.

`./dev bench bounce_colors` writes docs/authoring_colors.png and prints what changed: the mean indirect radiance by
channel, and the largest change of the direct light, which must be none.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.support import displayed, open_sample, rgb
from vlm_addon.core.color_changes import ColorChange, multiply, shift_hue
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.measure.contact_sheet import side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

OUT = Path(__file__).resolve().parents[1] / "docs"
SIZE_PX = 320
SAMPLES = 16
FACTOR = (5.0, 5.0, 5.0)
RED_TO_BLUE = -2.0 * np.pi / 3.0
RED_OVER_GREEN = 3.0
HEADER = ("red wall's lights", "indirect red", "green", "blue, W/(m² sr)", "largest change of direct light")


def main() -> None:
    """Renders, writes the sheet and prints the table."""
    scene = open_sample("cornell_box")
    light_mesh = scene.light_mesh
    assert light_mesh is not None
    red = light_mesh.colour[:, 0] > RED_OVER_GREEN * light_mesh.colour[:, 1]
    blue, stronger = shift_hue(RED_TO_BLUE, 1.0), multiply(FACTOR)
    variants: dict[str, ColorChange | None] = {
        "As the surface is": None,
        "Five times stronger": stronger,
        "Blue": blue,
        "Blue, five times stronger": lambda colors, middles: stronger(blue(colors, middles), middles),
    }
    with Device() as device:
        frames = {name: _frame(device, scene.snapshot, _changed(light_mesh, red, v)) for name, v in variants.items()}
    first = frames["As the surface is"].images["direct"]
    rows = []
    for name, frame in frames.items():
        means = frame.images["indirect"][..., :3].reshape(-1, 3).mean(axis=0)
        change = float(np.abs(frame.images["direct"] - first).max())
        rows.append((name, *(f"{mean:.4f}" for mean in means), f"{change:g}"))
    print(table(HEADER, rows))
    shown = [(name, displayed(OUT / "one.png", rgb(frame.images["combined"]))) for name, frame in frames.items()]
    (OUT / "one.png").unlink()
    side_by_side(shown).save(OUT / "authoring_colors.png")


def _changed(
    light_mesh: VirtualLightMesh, chosen: npt.NDArray[np.bool_], change: ColorChange | None
) -> VirtualLightMesh:
    if change is None:
        return light_mesh
    colour = light_mesh.colour.copy()
    middles = light_mesh.corners.mean(axis=1)
    colour[chosen] = change(colour[chosen].astype(np.float64), middles[chosen])
    return replace(light_mesh, colour=colour)


def _frame(device: Device, snapshot, light_mesh: VirtualLightMesh) -> Frame:
    return device.render(snapshot, light_mesh, RenderSettings(SIZE_PX, SIZE_PX, technique="vlm", samples=SAMPLES))


if __name__ == "__main__":
    main()
