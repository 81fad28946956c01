# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light of every kind of lamp on Diffuse and on default Principled surfaces against Cycles with 0 bounces.

The error is the mean of |ours - Cycles| / Cycles over the pixels above 1 % of Cycles' mean and farther than 3 pixels
from a shadow's edge. Edges are where the visibility (Cycles with shadows over ours without) jumps by more than a
quarter from one pixel to the next. The leak is the share of our light in pixels that are black in Cycles and farther
than 3 pixels from any that is not.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Vector
from PIL import Image

from benchmarks.support import open_sample, quiet, timed
from vlm_addon.blender.cycles_reference import Reference, render_reference
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.core.lamps import is_soft
from vlm_addon.core.scene import DIFFUSE, PRINCIPLED, Float32
from vlm_addon.measure.contact_sheet import error_map, side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.terminal import table

OUT = Path("build/light_units")
WIDTH_PX = 320
SAMPLES = 16
REFERENCE_SAMPLES = 128
# Penumbras are the noisiest part of a reference.
SOFT_REFERENCE_FACTOR = 8
SHADOW_SAMPLES = 64
DIM_SHARE = 0.01
EDGE_JUMP = 0.25
BAND_PX = 3
TARGETS = {"POINT": 0.02, "SPOT": 0.02, "SUN": 0.02, "AREA": 0.05}

# name: type, energy and values of Blender's lamp. Energies make a picture of ordinary brightness at 3 m.
LAMPS: dict[str, tuple[str, float, dict[str, Any]]] = {
    "point": ("POINT", 300.0, {"shadow_soft_size": 0.0}),
    "spot": ("SPOT", 300.0, {"shadow_soft_size": 0.0, "spot_size": math.radians(75.0), "spot_blend": 0.3}),
    "sun": ("SUN", 3.0, {"angle": 0.0}),
    "soft sun": ("SUN", 3.0, {"angle": math.radians(5.0)}),
    "area": ("AREA", 300.0, {"shape": "RECTANGLE", "size": 1.2, "size_y": 0.8}),
}
# sample scene: place of the lamps and what they look at, and the direction to the sun; m.
SCENES: dict[str, tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]] = {
    "cornell_box": ((0.6, 1.9, 5.2), (-0.1, 3.0, 0.0), (0.5, -1.0, 0.7)),
    "monkey_box": ((1.2, 0.5, 2.7), (0.0, 2.2, 0.8), (0.5, -1.0, 0.6)),
    "atrium": ((-5.0, -1.0, 6.5), (-2.0, 0.5, 0.0), (0.3, -0.2, 1.0)),
}
# Closed rooms let the sun in where these objects stood.
SUN_OPENINGS = {"monkey_box": ("Near wall",)}


def main() -> None:
    """Renders every combination, prints the errors and writes pictures: Cycles, ours, the relative difference."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--lamps", default=",".join(LAMPS))
    parser.add_argument("--models", default=f"{DIFFUSE},{PRINCIPLED}")
    parser.add_argument("--width", type=int, default=WIDTH_PX)
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--reference-samples", type=int, default=REFERENCE_SAMPLES)
    parser.add_argument("--shadow-resolution", type=int, default=RenderSettings.shadow_resolution)
    arguments = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    rows = []
    with Device() as device:
        for scene in arguments.scenes.split(","):
            for model in arguments.models.split(","):
                with quiet():
                    open_sample(scene)
                    _make_plain(model)
                for lamp in arguments.lamps.split(","):
                    rows.append((scene, model, lamp, *_compare(device, scene, model, lamp, arguments)))
                    print(*rows[-1], flush=True)
    header = (
        "scene",
        "material",
        "lamp",
        "error",
        "target",
        "median",
        "95th percentile",
        "noise",
        "pixels",
        "leak",
        "ms",
    )
    print(f"\n{table(header, rows)}")


def _make_plain(model: str) -> None:
    """Gives every material of the open scene one shader with the colour it has, and takes lamps and world away."""
    for lamp_object in [item for item in bpy.data.objects if item.type == "LIGHT"]:
        bpy.data.objects.remove(lamp_object)
    bpy.context.scene.world = None
    for material in bpy.data.materials:
        nodes, links = material.node_tree.nodes, material.node_tree.links
        shaders = [node for node in nodes if node.type in ("BSDF_DIFFUSE", "BSDF_PRINCIPLED")]
        color = tuple(shaders[0].inputs[0].default_value) if shaders else (0.8, 0.8, 0.8, 1.0)
        nodes.clear()
        kind = "ShaderNodeBsdfDiffuse" if model == DIFFUSE else "ShaderNodeBsdfPrincipled"
        shader, output = nodes.new(kind), nodes.new("ShaderNodeOutputMaterial")
        shader.inputs[0].default_value = color
        links.new(shader.outputs[0], output.inputs["Surface"])


def _add_lamp(scene: str, name: str) -> Any:
    kind, energy, values = LAMPS[name]
    place, target, to_sun = (Vector(vector) for vector in SCENES[scene])
    for wall in SUN_OPENINGS.get(scene, ()):
        bpy.data.objects[wall].hide_render = kind == "SUN"
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in values.items():
        setattr(data, key, value)
    lamp_object = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(lamp_object)
    lamp_object.location = place
    direction = -to_sun if kind == "SUN" else target - place
    lamp_object.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
    return lamp_object


def _compare(device: Device, scene: str, model: str, lamp: str, arguments: argparse.Namespace) -> tuple[str, ...]:
    lamp_object = _add_lamp(scene, lamp)
    render = bpy.context.scene.render
    width = arguments.width
    height = round(width * render.resolution_y / render.resolution_x)
    settings = RenderSettings(
        width,
        height,
        "direct",
        samples=arguments.samples,
        shadow_resolution=arguments.shadow_resolution,
        shadow_samples=SHADOW_SAMPLES,
    )
    with quiet():
        snapshot = extract_scene()
        factor = SOFT_REFERENCE_FACTOR if is_soft(snapshot.lights[0]) else 1
        reference = render_reference(width, height, 0, factor * arguments.reference_samples)
    frame, milliseconds = timed(lambda: device.render(snapshot, None, settings))
    bare = tuple(replace(light, casts_shadow=False) for light in snapshot.lights)
    unshadowed = device.render(replace(snapshot, lights=bare), None, settings).images["direct"].mean(axis=2)
    bpy.data.objects.remove(lamp_object)
    ours, theirs = frame.images["direct"].mean(axis=2), reference.images["combined"].mean(axis=2)
    counted = (theirs > DIM_SHARE * theirs.mean()) & ~_near_edge(theirs, unshadowed)
    relative = np.abs(ours - theirs) / np.maximum(theirs, DIM_SHARE * theirs.mean())
    _write_pictures(f"{scene}_{model}_{lamp}".lower().replace(" ", "_"), frame, reference, relative * counted)
    errors = relative[counted]
    return (
        f"{errors.mean():.2%}",
        f"{TARGETS[LAMPS[lamp][0]]:.0%}",
        f"{np.median(errors):.2%}",
        f"{np.quantile(errors, 0.95):.2%}",
        f"{reference.noise['combined']:.2%}",
        f"{counted.mean():.0%}",
        f"{ours[~_grown(theirs > 0.0)].sum() / ours.sum():.1e}",
        f"{milliseconds:.0f}",
    )


def _near_edge(shadowed: Float32, unshadowed: Float32) -> npt.NDArray[np.bool_]:
    """(h, w) whether a pixel lies within BAND_PX of a jump of the visibility."""
    visibility = np.divide(shadowed, unshadowed, out=np.zeros_like(shadowed), where=unshadowed > 0.0)
    edge = np.zeros(visibility.shape, bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(visibility, axis=axis)) > EDGE_JUMP
        edge |= np.insert(jump, 0, False, axis=axis) | np.insert(jump, jump.shape[axis], False, axis=axis)
    return _grown(edge)


def _grown(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(h, w) whether a pixel lies within BAND_PX of one in `mask`."""
    padded = np.pad(mask, BAND_PX)
    height, width = mask.shape
    reach = range(2 * BAND_PX + 1)
    return np.any([padded[y : y + height, x : x + width] for y in reach for x in reach], axis=0)


def _write_pictures(name: str, frame: Frame, reference: Reference, relative: Float32) -> None:
    """Cycles, ours and the relative error where it is counted, side by side."""
    shown = reference.images["combined"]
    white = float(np.quantile(shown[shown > 0.0], 0.9)) if shown.any() else 1.0
    pictures = [
        (label, Image.fromarray((255.0 * np.clip(image / white, 0.0, 1.0) ** (1.0 / 2.2)).astype(np.uint8)))
        for label, image in (("Cycles", reference.images["combined"]), ("ours", frame.images["direct"]))
    ]
    side_by_side([*pictures, ("relative error", error_map(relative))]).save(OUT / f"{name}.png")


if __name__ == "__main__":
    main()
