# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's lights against the integral over its map, and a courtyard under a sky against Cycles.

Errors of irradiance are shares of its mean over all orientations: root of the mean square and the largest. Errors of
pictures are relative RMSE, with the difference of the means; phase one is compared with itself at many lights, by the
radiosity of the virtual lights weighted with their areas.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import numpy as np

from benchmarks.support import ALONE, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.core.environment import map_directions, map_solid_angles
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import Environment, Float64, SceneSnapshot
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.world_light import world_lights
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.lamp_shadows import LampShadows
from vlm_addon.render.lit_lights import radiosity_of
from vlm_addon.render.passes.phase_one import PhaseOnePass
from vlm_addon.terminal import table

MAP_SIZE = (256, 512)
COUNTS = (16, 32, 64, 128, 256)
TRUTH_FACTOR = 4
"""Times the largest number in the tables: the lights of the phase one that the others are compared with."""
PICTURED_COUNTS = 4
"""So many of the numbers, from the first on, are rendered as pictures too."""
VIRTUAL_LIGHTS = 400
ORIENTATIONS = 400
NAMES = ("even", "sun")


def main() -> None:
    """Prints three tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="160x120")
    parser.add_argument("--skies", nargs="+", default=NAMES, choices=NAMES)
    parser.add_argument("--counts", nargs="+", type=int, default=COUNTS, help="numbers of lights")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--reference-samples", type=int, default=512)
    arguments = parser.parse_args()
    skies = [row for name in arguments.skies for row in irradiance_rows(name, arguments.counts)]
    print(table(("sky", "lights", "rms", "largest", "ms"), skies))
    pictures: list[tuple[str, ...]] = []
    radiosity: list[tuple[str, ...]] = []
    with Device() as device:
        for name in arguments.skies:
            with quiet():
                build_courtyard(radiance_map(name))
                snapshot = extract_scene()
            light_mesh = create_light_mesh(snapshot.meshes, SimplifySettings(VIRTUAL_LIGHTS)).light_mesh
            radiosity += phase_one_rows(device, name, snapshot, light_mesh, arguments.counts)
            pictures += picture_rows(device, name, snapshot, light_mesh, arguments)
    print(f"\n{table(('sky', 'lights', 'phase one, rms', 'power'), radiosity)}")
    header = ("sky", "lights", "of direct light", "direct", "mean", "noise", "indirect", "mean", "noise", "s")
    print(f"\n{table(header, pictures)}")


def radiance_map(name: str) -> Float64:
    """(h, w, 3): the same from everywhere, or a blue sky over dark ground with a sun."""
    directions = map_directions(*MAP_SIZE)
    if name == "even":
        return np.ones((*MAP_SIZE, 3))
    towards_sun = np.array([0.45, -0.5, 0.74]) / np.linalg.norm([0.45, -0.5, 0.74])
    cosine = directions @ towards_sun
    height = directions[..., 2:]
    sky = np.where(height > 0.0, np.array([0.3, 0.5, 0.9]) * (0.4 + 0.6 * height), 0.15)
    glow = 30.0 * np.exp(-2000.0 * (1.0 - cosine))[..., None] * (1.0, 0.9, 0.7)
    disk = (cosine > math.cos(math.radians(0.8)))[..., None] * np.array([9000.0, 8000.0, 6500.0])
    radiance: Float64 = sky + glow + disk
    return radiance


def irradiance_rows(name: str, counts: Sequence[int]) -> Iterator[tuple[str, ...]]:
    """For each count of lights."""
    index = np.arange(ORIENTATIONS) + 0.5
    z, turn = 1.0 - 2.0 * index / ORIENTATIONS, math.pi * (1.0 + math.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z * z)
    normals = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=-1)
    radiance = radiance_map(name)
    sent = (radiance * map_solid_angles(*MAP_SIZE)[:, None, None]).reshape(-1, 3)
    truth = np.maximum(normals @ map_directions(*MAP_SIZE).reshape(-1, 3).T, 0.0) @ sent
    environment = Environment(name, radiance.astype(np.float32), np.eye(3))
    for count in counts:
        start = time.perf_counter()
        lights = world_lights((0.0, 0.0, 0.0), environment, count)
        milliseconds = 1000.0 * (time.perf_counter() - start)
        found = sum(lamp_irradiance(light, np.zeros_like(normals), normals) for light in lights)
        errors = np.abs(found - truth) / truth.mean(axis=0)
        root = math.sqrt(np.mean(errors**2))
        yield name, str(count), f"{root:.2%}", f"{errors.max():.2%}", f"{milliseconds:.0f}"


def phase_one_rows(
    device: Device, name: str, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, counts: Sequence[int]
) -> Iterator[tuple[str, ...]]:
    """For each count of lights."""

    def radiosity(count: int) -> Float64:
        lights = world_lights(snapshot.world_radiance, snapshot.environment, count)
        with device.current() as context:
            geometry = GpuGeometry(context, snapshot)
            shadows = LampShadows(context, device.shaders, geometry, lights, RenderSettings.shadow_resolution)
            phase_one, lamps = PhaseOnePass(context, device.shaders), range(len(lights))
            falls = phase_one.render(light_mesh, geometry.origin, shadows, lamps, 1)
            return radiosity_of(light_mesh, falls).astype(np.float64)

    truth, areas = radiosity(TRUTH_FACTOR * max(counts)), light_mesh.areas[:, None]
    for count in counts:
        found = radiosity(count)
        error = math.sqrt((areas * (found - truth) ** 2).sum() / (areas * truth**2).sum())
        yield name, str(count), f"{error:.2%}", f"{(areas * found).sum() / (areas * truth).sum() - 1.0:+.2%}"


def picture_rows(
    device: Device, name: str, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, arguments: argparse.Namespace
) -> Iterator[tuple[str, ...]]:
    """For each count of lights."""
    width, height = (int(part) for part in arguments.size.split("x"))
    with quiet():
        reference = render_reference(width, height, 1, arguments.reference_samples)
    for count in arguments.counts[:PICTURED_COUNTS]:
        settings = RenderSettings(width, height, "vlm", samples=arguments.samples, world_lights=count, effects=ALONE)
        start = time.perf_counter()
        frame = device.render(snapshot, light_mesh, settings)
        seconds = time.perf_counter() - start
        cells: list[str] = []
        for kind in ("direct", "indirect"):
            ours, theirs = frame.images[kind].astype(np.float64), reference.images[kind].astype(np.float64)
            error = math.sqrt(np.mean((ours - theirs) ** 2)) / theirs.mean()
            cells += [f"{error:.1%}", f"{ours.mean() / theirs.mean() - 1.0:+.1%}", f"{reference.noise[kind]:.1%}"]
        yield name, str(count), f"{frame.counters['world_lights_direct']:.0f}", *cells, f"{seconds:.1f}"


def build_courtyard(radiance: Float64) -> None:
    """Four walls without a roof, a block and a ball in them, under an environment texture of `radiance` (h, w, 3)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    grey, red = _diffuse("grey", (0.7, 0.7, 0.7)), _diffuse("red", (0.7, 0.3, 0.2))
    side, top = 3.0, 2.5
    corners = [(-side, -side), (side, -side), (side, side), (-side, side)]
    _add_polygon("floor", [(x, y, 0.0) for x, y in corners], grey)
    for number, ((x0, y0), (x1, y1)) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        wall = [(x1, y1, 0.0), (x0, y0, 0.0), (x0, y0, top), (x1, y1, top)]
        _add_polygon(f"wall {number}", wall, red if number == 3 else grey)
    bpy.ops.mesh.primitive_cube_add(size=1.2, location=(0.6, 0.5, 0.6), rotation=(0.0, 0.0, 0.5))
    bpy.context.object.data.materials.append(red)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(-1.4, -0.2, 0.5))
    bpy.context.object.data.materials.append(grey)
    bpy.ops.object.shade_smooth()
    _add_camera()
    _add_world(radiance)


def _add_polygon(name: str, corners: list[tuple[float, float, float]], material: Any) -> None:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [tuple(range(len(corners)))])
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def _diffuse(name: str, color: tuple[float, float, float]) -> Any:
    material = bpy.data.materials.new(name)
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = (*color, 1.0)
    material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def _add_camera() -> None:
    data = bpy.data.cameras.new("camera")
    data.lens = 20.0
    camera = bpy.data.objects.new("camera", data)
    camera.location, camera.rotation_euler = (0.0, -2.7, 2.2), (1.0, 0.0, 0.0)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def _add_world(radiance: Float64) -> None:
    height, width = radiance.shape[:2]
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = radiance
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    world = bpy.context.scene.world = bpy.data.worlds.new("sky")
    nodes = world.node_tree.nodes
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    world.node_tree.links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])


if __name__ == "__main__":
    main()
