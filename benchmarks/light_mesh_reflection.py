# SPDX-License-Identifier: GPL-3.0-or-later
"""Light mesh reflection against Cycles: a glossy floor under a polygon, by roughness, height of the eye and polygon.

    python -m benchmarks.light_mesh_reflection

Metal is single-scatter GGX on both sides, the dielectric Blender's own Principled layer. In brackets: our mean over
Cycles'.
"""

from __future__ import annotations

from typing import Any

import bpy

from benchmarks.support import quiet
from tests.blender import test_light_mesh_reflection_against_cycles as scene
from vlm_addon.core.brdf import lookup_albedo
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device
from vlm_addon.terminal import table

SAMPLES = 64
HEIGHTS_M = (1.8, 0.5, 0.2)
ROUGHNESS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
POLYGONS = {
    "wall behind": scene.CORNERS,
    "panel overhead": ((-0.5, -0.3, 1.2), (0.6, -0.3, 1.2), (0.6, 0.6, 1.2), (-0.5, 0.6, 1.2)),
}


def main() -> None:
    """Prints relative RMSE and ratio of means of each case."""
    rows = []
    with Device() as device:
        for height in HEIGHTS_M:
            for name, corners in POLYGONS.items():
                for metallic in (1, 0):
                    pairs = [_pair(device, height, corners, roughness, metallic) for roughness in ROUGHNESS]
                    cells = [f"{scene.relative_rmse(*pair):.1%} ({_ratio(*pair):.3f})" for pair in pairs]
                    rows.append((f"{height} m", name, "metal" if metallic else "dielectric", *cells))
    print(table(("eye", "polygon", "floor", *(f"roughness {roughness}" for roughness in ROUGHNESS)), rows))


def _ratio(found: Float64, truth: Float64) -> float:
    return float(found.mean() / truth.mean())


def _pair(
    device: Device, height: float, corners: tuple[Any, ...], roughness: float, metallic: int
) -> tuple[Float64, Float64]:
    """Radiance of the floor's pixels by us and by Cycles."""
    with quiet():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        distribution = scene.SINGLE if metallic else scene.MULTIPLE
        found = scene.rival_pictures(
            device, _made_mesh, distribution, roughness, metallic, SAMPLES, corners=corners, height=height
        )
    ours, cycles, cosines = found
    if metallic:
        ours = ours * lookup_albedo(1.5, cosines, roughness)[:, 1]
    return ours, cycles


def _made_mesh(name: str, vertices: Any, faces: Any, material: Any) -> None:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, vertex)) for vertex in vertices], [], faces)
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))


if __name__ == "__main__":
    main()
