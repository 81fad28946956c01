# SPDX-License-Identifier: GPL-3.0-or-later
"""What ambient occlusion makes of indirect light that knows no visibility, against Cycles with one diffuse bounce.

"error" is the indirect error, "light" ours over Cycles'. The light mesh has the camera's view, light gathered from
reflective shadow maps has those maps' as well. "best factor" is the error with one number for all pixels in place of
the effect, the one with which that is least: what the effect has to beat to know where light is missing.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.support import open_sample, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.light_mesh_io import Extraction
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import Float32
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.terminal import table

SCENES = ("cornell_box", "monkey_box", "atrium")
TECHNIQUES = ("vlm", "rsm_gather")
RADII = (0.02, 0.05, 0.1, 0.2)
"""Of the scene's diagonal."""
PICTURES = 8
LIGHTS = 1000
"""Of the light mesh that is made where a scene has none."""


def main() -> None:
    """Prints a row for each scene, technique and radius."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help=f"sample scenes (default: {', '.join(SCENES)})")
    parser.add_argument("--size", type=int, default=64, help="pixels along a side of each picture")
    parser.add_argument("--reference-samples", type=int, default=512)
    parser.add_argument("--techniques", nargs="*", default=TECHNIQUES)
    options = parser.parse_args()
    rows: list[tuple[str, ...]] = []
    for scene in options.scenes:
        found = open_sample(scene)
        if found.light_mesh is None:
            made = create_light_mesh(found.snapshot.meshes, SimplifySettings(target_triangles=LIGHTS))
            found = replace(found, light_mesh=made.light_mesh)
        with quiet():
            reference = render_reference(options.size, options.size, 1, options.reference_samples)
        truth = reference.images["indirect"]
        with Device() as device:
            for technique in options.techniques:
                rows += _rows(device, found, technique, options.size, truth, scene)
        rows.append((scene, "noise of the reference", "", f"{reference.noise['indirect']:.1%}", ""))
    print(table(("scene", "technique", "radius", "error", "light"), rows))


def _rows(
    device: Device, found: Extraction, technique: str, size: int, truth: Float32, scene: str
) -> list[tuple[str, ...]]:
    def picture(effects: dict[str, object]) -> Float32:
        settings = RenderSettings(size, size, technique, samples=PICTURES, effects=effects)
        return device.render(found.snapshot, found.light_mesh, settings).images["indirect"]

    def row(name: str, image: Float32) -> tuple[str, ...]:
        return scene, technique, name, f"{relative_rmse(image, truth):.1%}", f"{image.mean() / truth.mean():.3f}"

    bare = picture({"ambient_occlusion": "off"})
    factor = np.float32(np.sum(bare * truth, dtype=np.float64) / max(np.sum(bare.astype(np.float64) ** 2), 1e-300))
    rows = [row("none", bare), row(f"best factor, {factor:.2f}", factor * bare)]
    for radius in RADII:
        rows.append(row(f"{radius}", picture({"ambient_occlusion": "on", "ambient_occlusion.radius": radius})))
    return rows


if __name__ == "__main__":
    main()
