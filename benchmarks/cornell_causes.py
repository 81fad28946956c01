# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the error of cornell_box's 44 lights comes from: occlusion, placement and resolution, with error images.

Each cause is the difference of two pictures that differ in it alone: Cycles has indirect visibility, the fine light
mesh on the visible surface has not (occlusion); the fine light mesh on the planes of the 44 lights lies elsewhere
(placement); the 44 lights are constant over each triangle (resolution).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.support import ALONE, displayed, open_sample, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.metrics import flip, relative_rmse
from vlm_addon.core.scene import Float32
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh, subdivide_light_mesh
from vlm_addon.measure.contact_sheet import error_map, side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.terminal import table

OUT = Path("build/cornell_causes")
SIZE_PX = 192
SAMPLES = 8
REFERENCE_SAMPLES = 1024
# The sphere's shape needs this many lights; the walls' few triangles are then halved down to the fine size.
SHAPE_LIGHTS = 500
FINE_LIGHTS = 8000


def main() -> None:
    """Renders the four pictures, prints the error of each cause and writes the error images."""
    OUT.mkdir(parents=True, exist_ok=True)
    scene = open_sample("cornell_box")
    drawn = scene.light_mesh
    on_surface = create_light_mesh(scene.snapshot.meshes, SimplifySettings(target_triangles=SHAPE_LIGHTS)).light_mesh
    with quiet():
        truth = render_reference(SIZE_PX, SIZE_PX, 1, REFERENCE_SAMPLES)
    with Device() as device:

        def picture(light_mesh: VirtualLightMesh) -> dict[str, Float32]:
            settings = RenderSettings(SIZE_PX, SIZE_PX, samples=SAMPLES, effects=ALONE)
            return device.render(scene.snapshot, light_mesh, settings).images

        fine = picture(subdivide_light_mesh(on_surface, FINE_LIGHTS))
        moved = picture(subdivide_light_mesh(drawn, FINE_LIGHTS))
        coarse = picture(drawn)
    causes = {
        "total": (coarse, truth.images),
        "occlusion": (fine, truth.images),
        "placement": (moved, fine),
        "resolution": (coarse, moved),
    }
    rows = [(name, *_errors(*pair, truth.images)) for name, pair in causes.items()]
    print(table(("cause", "indirect error", "total error", "FLIP"), rows))
    print(f"noise of the reference: {truth.noise['indirect']:.2%} indirect, {truth.noise['combined']:.2%} total")
    maps = [(f"{name} (one hue a decade)", error_map(_relative(*pair, truth.images))) for name, pair in causes.items()]
    shown = [(name, displayed(OUT / f"{name}.png", image)) for name, image in _shown(truth.images, coarse, fine, moved)]
    side_by_side([*shown, *maps], columns=4).save(OUT / "causes.png")
    print(f"pictures: {OUT}")


def _errors(a: dict[str, Float32], b: dict[str, Float32], truth: dict[str, Float32]) -> tuple[str, str, str]:
    """Of two pictures that differ in one cause, relative to the reference's mean."""
    errors = []
    for name in ("indirect", "combined"):
        scale = float(np.mean(b[name][..., :3]) / np.mean(truth[name][..., :3]))
        errors.append(f"{relative_rmse(a[name][..., :3], b[name][..., :3]) * scale:.2%}")
    return errors[0], errors[1], f"{flip(a['combined'][..., :3], b['combined'][..., :3])[0]:.3f}"


def _relative(a: dict[str, Float32], b: dict[str, Float32], truth: dict[str, Float32]) -> Float32:
    difference = np.abs(a["indirect"][..., :3] - b["indirect"][..., :3]).mean(axis=2)
    return difference / np.mean(truth["indirect"][..., :3])


def _shown(truth: dict[str, Float32], coarse: dict[str, Float32], fine: dict[str, Float32], moved: dict[str, Float32]):
    named = {"Cycles": truth, "44 lights": coarse, "fine on the surface": fine, "fine on the 44 planes": moved}
    return [(name, np.ascontiguousarray(images["combined"][..., :3])) for name, images in named.items()]


if __name__ == "__main__":
    main()
