# SPDX-License-Identifier: GPL-3.0-or-later
"""Light off lamp-lit walls in a glossy floor: screen reflection, map reflection and both against Cycles.

Errors are relative RMSE of the light in the floor alone, over its pixels; light: its mean over that of Cycles. What
neither the camera nor a lamp sees is black with us, so errors hold that as well. Milliseconds are of one picture.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from benchmarks.support import displayed, quiet
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.core.exr import image_of, read_exr
from vlm_addon.core.scene import Float32
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

ROUGHNESSES = (0.0, 0.1, 0.2, 0.3, 0.5)
EFFECTS = {"screen": (True, False), "maps": (False, True), "both": (True, True)}
"""Of the columns: whether screen and map reflection run."""
FLOOR = "floor"
COLOR = (0.9, 0.6, 0.3, 1.0)
WALLS = {
    # name: location, half extents, colour
    "back": ((0.0, 2.1, 1.5), (2.2, 0.1, 1.5), (0.7, 0.7, 0.7)),
    "front": ((0.0, -4.1, 1.5), (2.2, 0.1, 1.5), (0.7, 0.7, 0.7)),
    "left": ((-2.1, -1.0, 1.5), (0.1, 3.2, 1.5), (0.7, 0.15, 0.1)),
    "right": ((2.1, -1.0, 1.5), (0.1, 3.2, 1.5), (0.15, 0.5, 0.15)),
    "ceiling": ((0.0, -1.0, 3.1), (2.2, 3.2, 0.1), (0.7, 0.7, 0.7)),
    "box": ((-0.8, 0.8, 0.45), (0.4, 0.35, 0.45), (0.2, 0.3, 0.7)),
    "hanging": ((0.8, 0.5, 1.2), (0.45, 0.25, 0.25), (0.7, 0.5, 0.1)),
}


def main() -> None:
    """Prints the table; with --out writes the pictures too."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="96x72")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--reference-samples", type=int, default=256)
    parser.add_argument("--roughness", nargs="+", type=float, default=ROUGHNESSES)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    rows = []
    with Device() as device, quiet_folder() as folder:
        for roughness in arguments.roughness:
            with quiet():
                build_room(roughness)
                floor, reference = light_by_cycles(folder, width, height, arguments.reference_samples)
            found: dict[str, Float32] = {}
            row = [f"{roughness}"]
            for name, (screen, maps) in EFFECTS.items():
                frame = rendered(device, width, height, arguments.samples, screen, maps)
                found[name] = frame.images["specular"]
                row += compared(frame, found[name][floor], reference[floor], arguments.samples)
            rows.append(tuple(row))
            if arguments.out:
                picture = np.concatenate([reference, *found.values()], axis=1)
                displayed(arguments.out / f"reflections_{roughness}.png", np.ascontiguousarray(picture, np.float32))
    header = [f"{name} {part}" for name in EFFECTS for part in ("error", "light", "ms")]
    print(table(("roughness", *header), rows))


def compared(frame: Frame, ours: Float32, theirs: Float32, samples: int) -> list[str]:
    """Error, light and milliseconds, as text."""
    error = float(np.sqrt(np.mean((ours.astype(float) - theirs) ** 2)) / theirs.mean())
    names = ("reflective shadow maps", "screen reflection", "map reflection", "mix reflections")
    spent = sum(time for name, time in frame.timings if name in names)
    return [f"{error:.1%}", f"{float(ours.mean() / theirs.mean()):.1%}", f"{spent / samples:.0f}"]


def quiet_folder() -> tempfile.TemporaryDirectory[str]:
    """For Cycles' file."""
    return tempfile.TemporaryDirectory(prefix="vlm_reflections_")


def rendered(device: Device, width: int, height: int, samples: int, screen: bool, maps: bool) -> Frame:
    """Direct light in the open scene, and what of it shows in the floor."""
    names = {"screen_reflection": screen, "map_reflection": maps, "light_mesh_reflection": False}
    effects = {name: "on" if runs else "off" for name, runs in names.items()}
    settings = RenderSettings(width, height, "direct", samples=samples, buffers=True, effects=effects)
    with quiet():
        snapshot = extract_scene()
    return device.render(snapshot, None, settings)


def build_room(roughness: float) -> None:
    """A closed room with a metal floor and a lamp that the camera has behind it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    metal = _material(FLOOR, "ShaderNodeBsdfPrincipled", {"Base Color": COLOR, "Metallic": 1.0, "Roughness": roughness})
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.context.object.data.materials.append(metal)
    for name, (location, scale, color) in WALLS.items():
        bpy.ops.mesh.primitive_cube_add(size=2.0, location=location, scale=scale)
        matt = _material(name, "ShaderNodeBsdfDiffuse", {"Color": (*color, 1.0)})
        bpy.context.object.data.materials.append(matt)
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 100.0, 0.0
    camera = bpy.data.cameras.new("camera")
    camera.lens = 24.0
    for item, location in ((lamp, (0.3, -2.0, 2.4)), (camera, (0.2, -3.4, 1.5))):
        placed = bpy.data.objects.new(item.name, item)
        placed.location = location
        scene.collection.objects.link(placed)
    scene.camera = bpy.data.objects["camera"]
    direction = Vector((0.0, 0.6, 0.7)) - scene.camera.location
    scene.camera.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def _material(name: str, node: str, values: Mapping[str, Any]) -> Any:
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new(node), nodes.new("ShaderNodeOutputMaterial")
    for key, value in values.items():
        shader.inputs[key].default_value = value
    material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def light_by_cycles(folder: str, width: int, height: int, samples: int) -> tuple[np.ndarray, Float32]:
    """(h, w) which pixels show the floor alone; (h, w, 3) light off diffuse surfaces in glossy ones."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.render.engine = "CYCLES"
    values = {"samples": samples, "max_bounces": 1, "glossy_bounces": 1, "diffuse_bounces": 0, "blur_glossy": 0.0}
    values |= {"use_adaptive_sampling": False, "use_denoising": False, "sample_clamp_indirect": 0.0}
    values |= {"pixel_filter_type": "BOX", "device": "CPU"}
    for name, value in values.items():
        setattr(scene.cycles, name, value)
    for name in ("glossy_indirect", "glossy_color"):
        setattr(layer, f"use_pass_{name}", True)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type, settings.use_exr_interleave = "MULTI_LAYER_IMAGE", True
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    path = Path(folder) / "reference.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = read_exr(path)
    light, color = (next(_passes(channels, layer.name, names)) for names in _NAMES)
    return color.min(axis=2) > 0.99 * min(COLOR[:3]), light * color


_NAMES = (("Glossy Indirect", "GlossInd"), ("Glossy Color", "GlossCol"))
"""Of Cycles' passes: what Blender 5.0 and later call them in a file, and what earlier ones do."""


def _passes(channels: Mapping[str, Float32], layer: str, names: tuple[str, ...]) -> Iterator[Float32]:
    for name in names:
        if f"{layer}.{name}.R" in channels:
            yield image_of(channels, f"{layer}.{name}.")


if __name__ == "__main__":
    main()
