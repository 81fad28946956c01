# SPDX-License-Identifier: GPL-3.0-or-later
"""Table 5.1 of seed 004 for our scenes beside the published figures, and what visibility of virtual lights costs.

`./dev bench many_light` prints three tables. Published pictures have 768 x 768 and 1280 x 720 pixels: ours are that
divided by --divide, as two processor cores need. Milliseconds are those of Frame.timings, of each pass the least of
--runs frames of one sample a pixel; on a software renderer they are those of all its threads together, which mean the
same on a busy machine. With --reference-samples above 0, indirect light is compared with Cycles' of one bounce at the
middles of pixels: error (relative RMSE) and bias (difference of the means).

1. Table 5.1. As there, everything is made anew in each frame, standing or moving; "of what moves" is the octree as
   frames of an animation build it here. Ours includes hashes that tell what has changed, triangles behind voxels in the
   octree, one map for each lamp or four for an area lamp, shadow maps in direct light. "voxels alone": rays as
   published, which triangles do not end (exact_reach 0). Rays are those of the indirect light; "ns a light" is its
   time over pixels that show a surface times the lights that each of them sums, which does not depend on the size.
2. The technique `vlm` with each visibility and its settings, with 2,000 virtual lights. "once": what is built before
   the first frame and kept: octree or baked visibility. "frame": all other passes.
3. Settings of `many_light` in the first of the scenes, likewise; maps are drawn in each frame.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.many_light_published import LIGHTS, PUBLISHED, PUBLISHED_STAGES, TILES, Published
from benchmarks.support import ALONE, open_sample, quiet
from vlm_addon.blender.cycles_reference import Reference, render_reference
from vlm_addon.core.errors import VlmError
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import Float32, Mesh, SceneSnapshot
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh, subdivide_light_mesh
from vlm_addon.render.device import Device, PassTimer
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.kept import Kept
from vlm_addon.render.light_structures import LightStructures
from vlm_addon.terminal import table

DIVIDE, RUNS, ROOM_SIZE = 8, 2, 64
NUDGE = 1e-6
NOT_IN_A_FRAME = ("geometry", "read back")
ONCE = ("octree", "bake visibility", "occluders")
SHADOW_SAMPLES = 8

ROOMS = {"cornell_box": 500, "monkey_box": 1500}
"""Scenes of the second table: how many lights they are simplified to before large ones are halved."""
VIRTUAL_LIGHTS = 2000
OCTREE = {"visibility": "octree"}
BAKED = {"visibility": "baked"}
VISIBILITIES: dict[str, dict[str, Any]] = {
    "none": {},
    "octree, 1 ray": {**OCTREE, "visibility_rays": 1},
    "octree, 4 rays (default)": OCTREE,
    "octree, 16 rays": {**OCTREE, "visibility_rays": 16},
    "octree of 32³": {**OCTREE, "octree_resolution": 32},
    "octree of 256³": {**OCTREE, "octree_resolution": 256},
    "octree, triangles within 4 voxels": {**OCTREE, "exact_reach": 4},
    "octree, not filtered": {**OCTREE, "filter": "none"},
    "baked, 8 cells": {**BAKED, "visibility_cells": 8},
    "baked, 16 cells (default)": BAKED,
    "baked, 2 points": {**BAKED, "visibility_points": 2},
}
FEW = {"lights": 512}
MANY_LIGHTS: dict[str, dict[str, Any]] = {
    "512 lights": FEW,
    "2,048 lights (default)": {},
    "512, at every pixel": {**FEW, "interleave": 1},
    "512, 2 x 2": {**FEW, "interleave": 2},
    "512, 8 x 8": {**FEW, "interleave": 8},
    "512, not filtered": {**FEW, "filter": "none"},
    "512, voxels alone": {**FEW, "exact_reach": 0},
    "512, triangles within 4 voxels": {**FEW, "exact_reach": 4},
    "512, octree of 32³": {**FEW, "octree_resolution": 32},
    "512, octree of 256³": {**FEW, "octree_resolution": 256},
    "512, maps of 64 texels": {**FEW, "resolution": 64},
    "512, maps of 1,024 texels": {**FEW, "resolution": 1024},
    "512, one map for an area lamp": {**FEW, "area_maps": 1},
    "512, no light left out": {**FEW, "least_share": 0.0},
    "512, ten times as many left out": {**FEW, "least_share": 1e-2},
}


@dataclass(frozen=True)
class Best:
    """Of some frames of the same picture: the last one, and the least milliseconds of each pass."""

    frame: Frame
    passes: Mapping[str, float]


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--divide", type=float, default=DIVIDE, help="published sides by this; 1 on a GPU")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--reference-samples", type=int, default=0, help="of Cycles; 0: no errors, half the time")
    parser.add_argument("--room-size", type=int, default=ROOM_SIZE, help="sides of the pictures of tables 2 and 3")
    parser.add_argument("--scenes", nargs="*", choices=list(PUBLISHED), default=list(PUBLISHED), help="of table 5.1")
    parser.add_argument("--rooms", nargs="*", choices=list(ROOMS), default=list(ROOMS), help="of the other tables")
    options = parser.parse_args()
    with Device() as device:
        if device.is_software:
            device.timer = lambda: ProcessorTimer(device.context, True, [])  # type: ignore[method-assign]
        print(f"{device.name}; {os.cpu_count()} cores of {platform.machine()}, load {os.getloadavg()[0]:.1f}")
        for name in options.scenes:
            print(f"\n{published_table(device, PUBLISHED[name], options)}", flush=True)
        header = ("indirect error", "bias", "frame ms", "once ms")
        size = f"{options.room_size} x {options.room_size} pixels"
        for name in options.rooms:
            room = Room(device, name, options)
            visibility = table((name, *header), room.rows("vlm", VISIBILITIES))
            print(f"\n`vlm` with {VIRTUAL_LIGHTS:,} lights, {size}\n{visibility}", flush=True)
            if name == options.rooms[0]:
                print(
                    f"\n`many_light`, {size}\n{table((name, *header), room.rows('many_light', MANY_LIGHTS))}",
                    flush=True,
                )
    print(f"\nload at the end {os.getloadavg()[0]:.1f}")


class ProcessorTimer(PassTimer):
    """Milliseconds of all threads."""

    @property
    def kind(self) -> str:
        """How milliseconds are taken."""
        return "processor time of all threads"

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Adds what the block takes to pass `name`."""
        self._milliseconds.setdefault(name, 0.0)
        self._context.finish()
        start = time.process_time()
        yield
        self._context.finish()
        self._milliseconds[name] += 1e3 * (time.process_time() - start)


def published_table(device: Device, published: Published, options: argparse.Namespace) -> str:
    """One scene of table 5.1: a row for each stage, ours and the published figure at each number of lights."""
    scene = published.opened()
    width, height = (max(round(side / options.divide), 1) for side in published.size)
    size = width, height
    truth = reference_of(*size, options.reference_samples)
    columns, moving = [], 0.0
    anew = Anew(device, scene, size, published.resolution)
    for lights in LIGHTS:
        exact = anew.best({"lights": lights}, options.runs)
        voxels = anew.best({"lights": lights, "exact_reach": 0}, options.runs)
        columns.append(column(published, lights, exact, voxels, anew.shown, truth))
    if any(mesh.dynamic for mesh in scene.meshes):
        moving = anew.best({"lights": LIGHTS[0]}, options.runs, lambda mesh: mesh.dynamic).passes["octree"]
    header = [published.scene, *(text for lights in LIGHTS for text in (f"{lights:,} VPLs", "published"))]
    rows = [(name, *(cell for found in columns for cell in found[name])) for name in columns[0]]
    if moving:
        rows.insert(1, ("octree of what moves", *(f"{moving:.1f}", "") * len(LIGHTS)))
    noise = "" if truth is None else f"; noise of the reference {truth.noise['indirect']:.1%}"
    title = f"{scene.triangle_count:,} triangles, {published.resolution}³ voxels, {size[0]} x {size[1]} pixels"
    published_size = " x ".join(map(str, published.size))
    return f"{title} (published: {published_size}), ms{noise}\n{table(header, rows)}"


def column(
    published: Published, lights: int, exact: Best, voxels: Best, shown: int, truth: Reference | None
) -> dict[str, tuple[str, str]]:
    """Ours and the published figure at a number of lights, by row."""
    index = LIGHTS.index(lights)
    rows = {
        row: (f"{exact.passes[name]:.3g}", f"{published.stages[name][index]:.2f}")
        for name, row in PUBLISHED_STAGES.items()
    }
    rows["filter"] = f"{exact.passes['filter']:.3g}", ""
    published_ns = 1e6 * published.stages["indirect light"][index] / (np.prod(published.size) * lights / TILES)
    for label, found in (("triangles", exact), ("voxels alone", voxels)):
        ms, rays = found.passes["indirect light"], found.frame.counters["rays_per_pixel"]
        if found is not exact:
            rows[f"{label}: indirect light"] = f"{ms:.3g}", ""
        rows[f"{label}: rays a pixel"] = f"{rays:.1f}", ""
        rows[f"{label}: Mrays/s"] = f"{1e-3 * rays * shown / ms:.3f}", ""
        rows[f"{label}: ns a light"] = f"{1e6 * ms / (shown * lights / TILES):,.0f}", f"{published_ns:.2f}"
        if truth is not None:
            error, bias = against(found.frame, truth)
            rows[f"{label}: indirect error"] = error, ""
            rows[f"{label}: bias"] = bias, ""
    return rows


def everything(_: Mesh) -> bool:
    """All meshes."""
    return True


class Anew:
    """Frames in which everything is made again, as in the seed. shown: pixels that show a surface."""

    def __init__(self, device: Device, scene: SceneSnapshot, size: tuple[int, int], resolution: int) -> None:
        self._device, self._scene, self._size, self._resolution = device, scene, size, resolution
        self._count = 0
        settings = RenderSettings(*size, "direct", {}, 1, shadow_samples=1, buffers=True)
        found = device.render(scene, None, settings)
        self.shown = int((found.images["normal"] != 0.0).any(axis=2).sum())
        # Compiles shaders and makes buffers as large as they have to be.
        self._render({"lights": TILES}, everything)

    def best(self, values: Mapping[str, Any], runs: int, changes: Callable[[Mesh], bool] = everything) -> Best:
        """Of so many frames. changes: meshes that are other ones in each frame; all lamps are."""
        if changes is not everything:
            # The others have been other ones in the frame before.
            self._render(values, changes)
        frames = [self._render(values, changes) for _ in range(runs)]
        return Best(frames[-1], least(frames))

    def _render(self, values: Mapping[str, Any], changes: Callable[[Mesh], bool]) -> Frame:
        """A frame of a scene that differs a little from all before."""
        self._count += 1
        factor = 1.0 - NUDGE * self._count
        meshes = [
            replace(mesh, reflectance=nudged(mesh.reflectance, factor)) if changes(mesh) else mesh
            for mesh in self._scene.meshes
        ]
        lamps = [replace(lamp, power=scaled(lamp.power, factor)) for lamp in self._scene.lights]
        scene = replace(self._scene, meshes=tuple(meshes), lights=tuple(lamps))
        before = sum(self._device.kept.built.get(f"{kind}_octree", 0) for kind in ("static", "dynamic"))
        chosen = {"octree_resolution": self._resolution, **values}
        frame = self._device.render(scene, None, RenderSettings(*self._size, "many_light", chosen, 1, shadow_samples=1))
        built = sum(self._device.kept.built.get(f"{kind}_octree", 0) for kind in ("static", "dynamic")) - before
        expected = len({mesh.dynamic for mesh in scene.meshes if changes(mesh)})
        if built < expected or frame.counters["reflective_maps_drawn"] < frame.counters["reflective_maps"]:
            raise VlmError("the benchmark measured something that was kept from the frame before")
        return frame


def scaled(power: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    """Another power."""
    red, green, blue = power
    return factor * red, factor * green, factor * blue


def nudged(reflectance: Float32, factor: float) -> Float32:
    """Other values that look the same."""
    return (factor * reflectance).astype(np.float32)


class Room:
    """A scene of the other tables with its virtual lights, and Cycles' picture of it."""

    def __init__(self, device: Device, name: str, options: argparse.Namespace) -> None:
        self._device, self._options = device, options
        self._scene = open_sample(name).snapshot
        shapes = create_light_mesh(self._scene.meshes, SimplifySettings(target_triangles=ROOMS[name])).light_mesh
        self._light_mesh = subdivide_light_mesh(shapes, VIRTUAL_LIGHTS)
        self._truth = reference_of(options.room_size, options.room_size, options.reference_samples)

    def rows(self, technique: str, variants: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, ...]]:
        """A line for each of the settings."""
        rows: list[tuple[str, ...]] = [
            (label, *self._measured(technique, values)) for label, values in variants.items()
        ]
        if self._truth is not None:
            rows.append(("noise of the reference", f"{self._truth.noise['indirect']:.1%}", "", "", ""))
        return rows

    def _measured(self, technique: str, values: Mapping[str, Any]) -> tuple[str, str, str, str]:
        """Error, bias, and ms of a frame and of what is made once."""
        device, side = self._device, self._options.room_size
        lights = self._light_mesh if technique == "vlm" else None
        settings = RenderSettings(side, side, technique, values, 1, shadow_samples=SHADOW_SAMPLES, effects=ALONE)
        # Compiles shaders; what that makes is forgotten.
        device.render(self._scene, lights, replace(settings, width=8, height=8))
        frames = []
        for _ in range(self._options.runs):
            device.kept = Kept()
            device.light_structures = LightStructures(device.kept, on_device=not device.is_software)
            frames.append(device.render(self._scene, lights, settings))
        passes = least(frames)
        once = sum(ms for name, ms in passes.items() if name in ONCE)
        frame = sum(ms for name, ms in passes.items() if name not in (*NOT_IN_A_FRAME, *ONCE))
        error, bias = ("", "") if self._truth is None else against(frames[-1], self._truth)
        return error, bias, f"{frame:,.0f}", f"{once:,.0f}" if once else ""


def least(frames: Sequence[Frame]) -> dict[str, float]:
    """Milliseconds of each pass: the least of all frames."""
    return {name: min(dict(frame.timings)[name] for frame in frames) for name, _ in frames[0].timings}


def reference_of(width: int, height: int, samples: int) -> Reference | None:
    """Of the scene that is open in Blender; None for no samples."""
    if not samples:
        return None
    with quiet():
        return render_reference(width, height, 1, samples, at_centres=True)


def against(frame: Frame, truth: Reference) -> tuple[str, str]:
    """Error and bias of the indirect light."""
    found, expected = frame.images["indirect"], truth.images["indirect"]
    return f"{relative_rmse(found, expected):.1%}", f"{found.mean() / expected.mean() - 1.0:+.1%}"


if __name__ == "__main__":
    main()
