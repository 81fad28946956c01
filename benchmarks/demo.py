# SPDX-License-Identifier: GPL-3.0-or-later
"""`./dev demo`: cornell_box without and with its light mesh beside Cycles, with times and errors, into demo/."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.support import displayed, open_sample, quiet, rgb, timed
from vlm_addon.blender.cycles_reference import CONVERGED_BOUNCES, Reference, render_reference
from vlm_addon.core.metrics import flip, relative_rmse
from vlm_addon.core.scene import Float32
from vlm_addon.measure.contact_sheet import side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

OUT = Path("demo")
SIZE_PX = 320
SAMPLES = 16
REFERENCE_SAMPLES = {1: 256, CONVERGED_BOUNCES: 96}
HEADER = ("step", "ms", "error", "indirect error", "FLIP")
MEANING = (
    "error: relative RMSE of the picture, indirect error: of the diffuse indirect light alone, FLIP: mean difference\n"
    "that an eye sees; all against Cycles with one diffuse bounce. Cycles' rows give its own noise."
)


def main() -> None:
    """Renders, writes the pictures and prints the table."""
    OUT.mkdir(exist_ok=True)
    scene, extraction_ms = timed(lambda: open_sample("cornell_box"))
    with Device() as device:
        frames = {name: timed(lambda name=name: _frame(device, scene, name)) for name in ("direct", "vlm")}
        device_name = device.name
    references = {bounces: timed(lambda bounces=bounces: _reference(bounces)) for bounces in REFERENCE_SAMPLES}
    truth = references[1][0].images
    rows = [("open and extract", f"{extraction_ms:.0f}", "", "", "")]
    for name, (frame, ms) in frames.items():
        rows.append((f"{name}, {SAMPLES} samples on {device_name}", f"{ms:.0f}", *_errors(frame, truth)))
        rows += [(f"  {pass_name}", f"{pass_ms:.0f}", "", "", "") for pass_name, pass_ms in frame.timings]
    for bounces, (reference, ms) in references.items():
        name = "one bounce" if bounces == 1 else "converged"
        label = f"Cycles, {name}, {REFERENCE_SAMPLES[bounces]} samples"
        noise = reference.noise
        rows.append((label, f"{ms:.0f}", f"+-{noise['combined']:.1%}", f"+-{noise['indirect']:.1%}", ""))
    converged = references[CONVERGED_BOUNCES][0].images
    rows.append(("vlm against Cycles, converged", "", *_errors(frames["vlm"][0], converged)))
    _write_pictures(frames["direct"][0], frames["vlm"][0], truth, converged)
    print(f"\n{table(HEADER, rows)}\n\n{MEANING}\n\nPictures: {OUT.resolve()}")


def _frame(device: Device, scene, technique: str) -> Frame:
    settings = RenderSettings(SIZE_PX, SIZE_PX, technique=technique, samples=SAMPLES)
    return device.render(scene.snapshot, scene.light_mesh, settings)


def _reference(bounces: int) -> Reference:
    print(f"Cycles, {REFERENCE_SAMPLES[bounces]} samples, at most {bounces} diffuse bounces …", flush=True)
    with quiet():
        return render_reference(SIZE_PX, SIZE_PX, bounces, REFERENCE_SAMPLES[bounces])


def _errors(frame: Frame, truth: dict[str, Float32]) -> tuple[str, str, str]:
    picture = rgb(frame.images["combined"])
    return (
        f"{relative_rmse(picture, truth['combined']):.1%}",
        f"{relative_rmse(frame.images['indirect'], truth['indirect']):.1%}",
        f"{flip(picture, truth['combined'])[0]:.3f}",
    )


def _write_pictures(direct: Frame, vlm: Frame, one_bounce: dict[str, Float32], converged: dict[str, Float32]) -> None:
    pictures = {
        "direct.png": ("Direct light only", rgb(direct.images["combined"])),
        "vlm.png": ("Virtual Light Mesh, 44 lights", rgb(vlm.images["combined"])),
        "reference.png": ("Cycles, one diffuse bounce", one_bounce["combined"]),
        "reference_converged.png": ("Cycles, converged", converged["combined"]),
    }
    shown = [(label, displayed(OUT / name, np.asarray(image, np.float32))) for name, (label, image) in pictures.items()]
    side_by_side(shown).save(OUT / "comparison.png")


if __name__ == "__main__":
    main()
