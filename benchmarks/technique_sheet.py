# SPDX-License-Identifier: GPL-3.0-or-later
"""Every technique on four sample scenes beside Cycles with one bounce: one picture, and a table of errors.

`./dev bench technique_sheet` writes docs/techniques.jpg. Techniques with their default settings; light meshes of
--lights lights where the scene has none of its own. Errors as in the README: of the whole picture, of the indirect
diffuse light alone, and FLIP; in brackets the reference's own noise. docs/techniques.md says what is seen.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from PIL import Image

from benchmarks.support import ALONE, displayed, open_sample, quiet, rgb
from vlm_addon.blender.cycles_reference import Reference, render_reference
from vlm_addon.blender.extraction.light_mesh_io import Extraction
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.metrics import flip, relative_rmse
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.measure.contact_sheet import side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.technique import technique_list
from vlm_addon.terminal import table

SCENES = ("cornell_box", "monkey_box", "atrium", "lightwave_room")
TARGET = Path("docs/techniques.jpg")
SAMPLES = 4
HEADER = ("scene", "technique", "ms", "error", "indirect error", "FLIP")
SETTINGS: dict[tuple[str, str], dict[str, object]] = {("atrium", "lightwave"): {"computed_at": "pixels"}}
"""Other than the defaults: the atrium's 218,000 corners take minutes on two cores."""
PREPARED = ("geometry", "read back")
"""Passes that are no part of a technique."""


def main() -> None:
    """Renders every scene by every technique and by Cycles, writes the sheet and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=192, help="pixels along a side of each picture")
    parser.add_argument("--lights", type=int, default=2000)
    parser.add_argument("--reference-samples", type=int, default=256)
    parser.add_argument("--scenes", nargs="+", default=SCENES, choices=SCENES)
    parser.add_argument("--out", type=Path, default=TARGET)
    options = parser.parse_args()
    pictures: list[tuple[str, Image.Image]] = []
    rows: list[tuple[str, ...]] = []
    with Device() as device, tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "picture.png"
        for name in options.scenes:
            scene = open_sample(name)
            lights = _light_mesh(scene, options.lights)
            with quiet():
                truth = render_reference(options.size, options.size, 1, options.reference_samples)
            for technique in technique_list():
                chosen = SETTINGS.get((name, technique.name), {})
                settings = RenderSettings(options.size, options.size, technique.name, chosen, SAMPLES, effects=ALONE)
                frame = device.render(scene.snapshot, lights, settings)
                print(f"{name}, {technique.name} …", flush=True)
                pictures.append((technique.name, displayed(target, rgb(frame.images["combined"]))))
                rows.append((name, technique.name, *_figures(frame, truth)))
            pictures.append((f"Cycles: {name}", displayed(target, truth.images["combined"])))
            noise = (f"({truth.noise[part]:.1%})" for part in ("combined", "indirect"))
            rows.append((name, "Cycles, one bounce", "", *noise, ""))
        print(f"{device.name}, {options.size} x {options.size}, {SAMPLES} samples")
    side_by_side(pictures, columns=len(technique_list()) + 1).save(options.out, quality=88)
    print(table(HEADER, rows))
    print(f"picture: {options.out}")


def _light_mesh(scene: Extraction, lights: int) -> VirtualLightMesh:
    """That of the scene, else one made of what is visible."""
    if scene.light_mesh:
        return scene.light_mesh
    return create_light_mesh(scene.snapshot.meshes, SimplifySettings(target_triangles=lights)).light_mesh


def _figures(frame: Frame, truth: Reference) -> tuple[str, ...]:
    picture = rgb(frame.images["combined"])
    milliseconds = sum(ms for name, ms in frame.timings if name not in PREPARED)
    return (
        f"{milliseconds:,.0f}",
        f"{relative_rmse(picture, truth.images['combined']):.1%}",
        f"{relative_rmse(frame.images['indirect'], truth.images['indirect']):.1%}",
        f"{flip(picture, truth.images['combined'])[0]:.3f}",
    )


if __name__ == "__main__":
    main()
