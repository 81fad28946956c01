# SPDX-License-Identifier: GPL-3.0-or-later
"""Ambient occlusion against rays and against Cycles.

Mean absolute errors over the pixels that show a surface, at their middles. "one view" is the camera's; "joined" and
"weighted" are the camera's and those of the lamps' reflective shadow maps. "above" is ours less the rays', on average.
"Cycles" is the distance of our rays to Cycles' node of the same name, then of each estimate to Cycles.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from PIL import Image

from benchmarks.support import open_sample, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.core.ambient_occlusion import openness
from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.core.triangle_tree import build_tree
from vlm_addon.measure.contact_sheet import side_by_side
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.ambient_occlusion import JOINED, WEIGHTED, AmbientOcclusionPass, OcclusionSettings
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.rsm import LampReflections
from vlm_addon.render.view import make_view
from vlm_addon.terminal import table

OUT = Path("build/ambient_occlusion")
SCENES = ("monkey_box", "cornell_box")
RADII = (0.02, 0.05, 0.1, 0.2)
"""Of the scene's diagonal."""
PICTURES = 16
STRATA = 12
RESOLUTION, AREA_MAPS = 256, 4
SHOWN_SIDE = 288
CYCLES_SAMPLES, NODE_SAMPLES = 4, 64


@dataclass(frozen=True)
class Surfaces:
    """What the pixels' middles show, (h, w, 3) in world space; shown: (h, w)."""

    positions: Float64
    normals: Float64
    planes: Float64
    shown: np.ndarray


def main() -> None:
    """Prints a row for each scene, radius and way, and writes the pictures side by side."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help=f"sample scenes (default: {', '.join(SCENES)})")
    parser.add_argument("--size", type=int, default=96, help="pixels along a side of each picture")
    parser.add_argument("--radii", type=float, nargs="*", default=RADII, help="shares of the scene's diagonal")
    options = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in options.scenes:
        snapshot = open_sample(scene).snapshot
        low, high = snapshot.bounds()
        diagonal = float(np.linalg.norm(high - low))
        with Device() as device:
            for radius in options.radii:
                found = _estimates(device, snapshot, options.size, radius)
                truth = _by_rays(snapshot, found.surfaces, radius * diagonal)
                with quiet():
                    cycles = _by_cycles(options.size, radius * diagonal)
                rows += _rows(scene, radius, found, truth, cycles)
                named = {"rays": truth, "Cycles": cycles, **found.pictures}
                side_by_side([(name, _grey(image)) for name, image in named.items()]).save(
                    OUT / f"{scene}_{radius}.png"
                )
    print(table(("scene", "radius", "way", "error", "above", "Cycles"), rows))
    print(f"pictures: {OUT}")


@dataclass(frozen=True)
class Estimates:
    """Mean openness of PICTURES pictures by way, and of the first alone."""

    pictures: dict[str, Float64]
    surfaces: Surfaces


def _estimates(device: Device, snapshot: SceneSnapshot, size: int, radius: float) -> Estimates:
    with device.current() as context:
        space = make_local_space(snapshot)
        local = space.scene(snapshot)
        assert local.camera is not None
        geometry = GpuGeometry(context, local, np.zeros(3))
        view = make_view(local.camera, size, size, geometry.origin)
        gbuffers = GBufferPass(context, device.shaders, size, size)
        maps = LampReflections(context, device.shaders, device.kept, snapshot, RESOLUTION, AREA_MAPS)
        maps.draw()

        def mean(count: int, combine: str | None) -> Float64:
            settings = OcclusionSettings(radius=radius, combine=combine or JOINED)
            chosen = AmbientOcclusionPass(context, device.shaders, size, size, settings)
            total = np.zeros((size, size))
            for index in range(count):
                gbuffer = gbuffers.render(geometry, view, 0)
                views = maps.maps() if combine is not None else ()
                total += read_image(chosen.render(gbuffer, view, index, views, space))[..., 0]
            return total / count

        pictures = {
            "one view, one picture": mean(1, None),
            "one view": mean(PICTURES, None),
            "joined": mean(PICTURES, JOINED),
            "weighted": mean(PICTURES, WEIGHTED),
        }
        gbuffer = gbuffers.render(geometry, view, 0)
        textures = gbuffer.position, gbuffer.shading_normal, gbuffer.geometric_normal
        positions, normals, planes = (read_image(texture)[..., :3] for texture in textures)
        shown = np.any(planes != 0.0, axis=2)
        surfaces = Surfaces(space.world_points(positions), normals.astype(float), planes.astype(float), shown)
    return Estimates(pictures, surfaces)


def _by_rays(snapshot: SceneSnapshot, surfaces: Surfaces, radius_m: float) -> Float64:
    """(h, w), 1 where nothing shows."""
    tree = build_tree(np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes]))
    shown = surfaces.shown
    points = surfaces.positions[shown], surfaces.normals[shown], surfaces.planes[shown]
    result = np.ones(shown.shape)
    result[shown] = openness(tree, *points, radius_m, STRATA)
    return result


def _by_cycles(size: int, radius_m: float) -> Float64:
    """(h, w) of the open scene, 0 where nothing shows."""
    with _occlusion_material(radius_m):
        found = render_reference(size, size, 0, CYCLES_SAMPLES, at_centres=True)
    return found.images["emission"][..., 0].astype(np.float64)


@contextmanager
def _occlusion_material(radius_m: float) -> Iterator[None]:
    """Every surface glows with how open it is."""
    material = bpy.data.materials.new("openness")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output, emission = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeEmission")
    occlusion = nodes.new("ShaderNodeAmbientOcclusion")
    occlusion.samples = NODE_SAMPLES
    occlusion.inputs["Distance"].default_value = radius_m
    links.new(occlusion.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs[0], output.inputs["Surface"])
    layer = bpy.context.view_layer
    layer.material_override = material
    try:
        yield
    finally:
        layer.material_override = None
        bpy.data.materials.remove(material)


def _rows(scene: str, radius: float, found: Estimates, truth: Float64, cycles: Float64) -> list[tuple[str, ...]]:
    shown = found.surfaces.shown

    def error(a: Float64, b: Float64) -> str:
        return f"{np.abs(a - b)[shown].mean():.4f}"

    rows = [(scene, f"{radius}", "rays", "", f"{truth[shown].mean():.3f} open", error(truth, cycles))]
    for name, picture in found.pictures.items():
        above = f"{(picture - truth)[shown].mean():+.4f}"
        rows.append((scene, f"{radius}", name, error(picture, truth), above, error(picture, cycles)))
    return rows


def _grey(image: Float64) -> Image.Image:
    grey = Image.fromarray(np.round(255.0 * np.clip(image, 0.0, 1.0)).astype(np.uint8)).convert("RGB")
    return grey.resize((SHOWN_SIDE, SHOWN_SIDE), Image.Resampling.NEAREST)


if __name__ == "__main__":
    main()
