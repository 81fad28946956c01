# SPDX-License-Identifier: GPL-3.0-or-later
"""Frame times of the gather from reflective shadow maps on the city, in the rows of seed 003's tables 7.1 to 7.6.

The published figures are those of Haragăs 2023 on a GeForce RTX 2060 SUPER with a model of ancient Rome of 4 million
triangles, indirect diffuse light by 200 static samples; from table 7.2 on with specular reflections and ambient
occlusion as well. Ours are of the city in sample_blends and of the passes that the seed's frame has: G-buffer, direct
light with shadow maps, reflective shadow maps, gather at every pixel. The last columns are the gather alone, of every
fourth pixel with interpolation, and of the pattern of 10 samples that the seed cites, once it has a history (where
lamps move it has none, and takes all 200). Without options the city, the picture and the maps are small; --long takes
the published sizes.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.support import ROOT, quiet
from vlm_addon.blender.light_mesh_io import extract
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.core.scene import SPOT, SUN, Float64, Light, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.passes.shadow_map import SINGLE_TILE_FACTOR
from vlm_addon.terminal import table

FULL_TRIANGLES = 4_000_000
PASSES = ("G-buffer", "direct light", "reflective shadow maps", "gather", "accumulate")
ORDER = (SUN, SPOT, SPOT, SUN, SPOT)
"""Kinds of the lights in the order in which the seed adds them (7.4)."""
SUN_IRRADIANCE = 3.0
SPOT_IRRADIANCE = 20.0
"""W/m², on a surface below the lamp."""
TURN = math.radians(4.0)
"""Of a moving lamp from one frame to the next."""
HALF, SQUARE = 50.0, (800, 800)
"""Percent and pixels of all tables that do not vary them."""


@dataclass(frozen=True)
class Sizes:
    """How large everything is. triangles: of the whole city. scale: of the pictures' sides. map_side: texels. frames:
    that are measured, after one."""

    triangles: int
    scale: float
    map_side: int
    frames: int


SHORT = Sizes(40_000, 0.1, 256, 3)
LONG = Sizes(FULL_TRIANGLES, 1.0, 2048, 5)


@dataclass(frozen=True)
class Row:
    """One row. published: frames per second and milliseconds. moving: lights that turn between frames."""

    label: str
    published: tuple[float, float]
    percent: float = HALF
    kinds: tuple[str, ...] = ORDER[:1]
    size: tuple[int, int] = SQUARE
    moving: int = 0
    technique: str = "rsm_gather"


HEADS = ("", "FPS published", "ms published", "FPS", "ms", "maps drawn", "gather ms", "of every 4th pixel", "10 of 200")
TABLES = {
    "7.1 algorithms": (
        Row("None", (60.41, 16.60), 100.0, technique="direct"),
        Row("ID", (23.99, 42.28), 100.0),
    ),
    "7.2 share of the city": tuple(
        Row(f"{percent:g} %", figures, percent)
        for percent, figures in (
            (0.1, (60.68, 16.53)),
            (1.0, (60.52, 16.54)),
            (10.0, (60.49, 16.60)),
            (25.0, (56.48, 18.19)),
            (50.0, (32.63, 30.98)),
            (75.0, (22.22, 45.44)),
            (100.0, (18.10, 55.96)),
        )
    ),
    "7.3 kinds of lights": (
        Row("Direct 1", (32.63, 30.98), kinds=(SUN,)),
        Row("Spotlight 1", (30.63, 33.17), kinds=(SPOT,)),
        Row("Direct 2", (17.30, 58.47), kinds=(SUN, SUN)),
        Row("Spotlight 2", (17.10, 59.35), kinds=(SPOT, SPOT)),
    ),
    "7.4 number of lights": tuple(
        Row(str(count), figures, kinds=ORDER[:count])
        for count, figures in enumerate(
            ((32.63, 30.98), (17.30, 59.03), (11.66, 86.85), (8.85, 115.42), (7.29, 144.49)), 1
        )
    ),
    "7.5 resolution": tuple(
        Row(f"{width}x{height}", figures, kinds=ORDER[:3], size=(width, height))
        for (width, height), figures in (
            ((480, 360), (24.39, 26.10)),
            ((640, 480), (24.15, 41.88)),
            ((800, 800), (11.66, 86.85)),
            ((1280, 720), (13.76, 76.92)),
            ((1920, 1080), (8.14, 124.24)),
        )
    ),
    "7.6 moving lights": tuple(
        Row(str(moving), figures, kinds=(SPOT,) * 3, moving=moving)
        for moving, figures in enumerate(((11.66, 86.85), (11.42, 87.56), (11.35, 88.10), (11.28, 88.56)))
    ),
}


def city(percent: float, triangles: int) -> SceneSnapshot:
    """That share of a city of so many triangles, without its lights."""
    share = max(100.0 * triangles / FULL_TRIANGLES * percent / 100.0, 1e-3)
    build = ROOT / "sample_blends" / "build.py"
    with tempfile.TemporaryDirectory() as folder, quiet():
        command = [sys.executable, str(build), "city", "--percent", f"{share:.6f}", "--out", folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        open_scene(Path(folder) / "city.blend")
        return replace(extract().snapshot, lights=())


def lights(kinds: tuple[str, ...], snapshot: SceneSnapshot) -> tuple[Light, ...]:
    """Around the city and above it, each turned to its middle; spots have 90 degrees, as the seed's."""
    low, high = snapshot.bounds()
    middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    found = []
    for index, kind in enumerate(kinds):
        turn = 2.0 * math.pi * index / len(ORDER) + 0.4
        away = np.array([0.6 * math.cos(turn), 0.6 * math.sin(turn), 0.9])
        away /= np.linalg.norm(away)
        place = middle + 0.8 * radius * away
        power = SUN_IRRADIANCE if kind == SUN else SPOT_IRRADIANCE * 4.0 * math.pi * (0.8 * radius) ** 2
        light = Light(f"{kind} {index}", kind, (power,) * 3, _triple(place), spot_angle=0.5 * math.pi, spot_blend=0.1)
        found.append(_turned_to(light, away))
    return tuple(found)


def _triple(values: Float64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _turned_to(light: Light, z_axis: Float64) -> Light:
    x_axis = np.cross([0.0, 0.0, 1.0], z_axis)
    x_axis /= np.linalg.norm(x_axis)
    axes = (x_axis, np.cross(z_axis, x_axis), z_axis)
    return replace(light, **dict(zip(("x_axis", "y_axis", "z_axis"), map(_triple, axes), strict=True)))


def turned(light: Light, frame: int) -> Light:
    """The lamp as it looks after so many frames of turning about the vertical."""
    c, s = math.cos(frame * TURN), math.sin(frame * TURN)
    return _turned_to(light, np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array(light.z_axis))


@dataclass(frozen=True)
class Measured:
    """Milliseconds of the passes of a frame and of the gather in it, and maps that it drew."""

    whole_ms: float
    gather_ms: float
    drawn: int


def measured(device: Device, scene: SceneSnapshot, row: Row, sizes: Sizes, **values: object) -> Measured:
    """The least over the frames, since other programs only ever add to it, and the last one's number of maps. values:
    settings of rsm_gather."""
    width, height = (max(round(side * sizes.scale), 1) for side in row.size)
    if row.technique == "rsm_gather":
        values = {"resolution": sizes.map_side // SINGLE_TILE_FACTOR, **values}
    settings = RenderSettings(width, height, row.technique, values, 1, sizes.map_side, 1)
    around = lights(row.kinds, scene)
    frames: list[Frame] = []
    for number in range(sizes.frames + 1):
        moved = tuple(turned(light, number) if i < row.moving else light for i, light in enumerate(around))
        frames.append(device.render(replace(scene, lights=moved), None, settings))
    times = [dict(frame.timings) for frame in frames[1:]]
    whole = min(sum(frame.get(name, 0.0) for name in PASSES) for frame in times)
    gather = min(frame.get("gather", 0.0) for frame in times)
    return Measured(whole, gather, int(frames[-1].counters.get("reflective_maps_drawn", 0)))


def rows_of(name: str, device: Device, sizes: Sizes, cities: dict[float, SceneSnapshot]) -> list[tuple[str, ...]]:
    """The rows of one table as text."""
    rows = []
    for row in TABLES[name]:
        if row.percent not in cities:
            cities[row.percent] = city(row.percent, sizes.triangles)
        scene = cities[row.percent]
        published = f"{row.published[0]:.2f}", f"{row.published[1]:.2f}"
        if row.technique != "rsm_gather":
            found = measured(device, scene, row, sizes)
            rows.append((row.label, *published, f"{1e3 / found.whole_ms:.2f}", f"{found.whole_ms:.1f}", *[""] * 4))
            continue
        found, coarse, part = (
            measured(device, scene, row, sizes, **values)
            for values in ({"low_resolution": 1}, {}, {"low_resolution": 1, "pattern": "rotating"})
        )
        ours = f"{1e3 / found.whole_ms:.2f}", f"{found.whole_ms:.1f}", str(found.drawn)
        gathers = (f"{each.gather_ms:.1f}" for each in (found, coarse, part))
        rows.append((row.label, *published, *ours, *gathers))
    return rows


def main() -> None:
    """Prints the tables, all or those whose numbers are given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", action="store_true", help="the published sizes: a GPU is needed")
    parser.add_argument("--triangles", type=int, help="of the whole city")
    parser.add_argument("--scale", type=float, help="of the pictures' sides")
    parser.add_argument("--maps", type=int, help="texels along a map")
    parser.add_argument("tables", nargs="*", metavar="7.N", help="which tables (default: all)")
    chosen = parser.parse_args()
    base = LONG if chosen.long else SHORT
    sizes = Sizes(
        chosen.triangles or base.triangles, chosen.scale or base.scale, chosen.maps or base.map_side, base.frames
    )
    cities: dict[float, SceneSnapshot] = {}
    with Device() as device:
        print(
            f"{device.name}; city of {sizes.triangles:,} triangles; pictures at {sizes.scale:g} of the published side;"
        )
        print(f"maps of {sizes.map_side} texels a side; the fastest of {sizes.frames} frames after one\n")
        for name in TABLES:
            if not chosen.tables or name.split()[0] in chosen.tables:
                print(f"Table {name}")
                print(table(HEADS, rows_of(name, device, sizes, cities)), flush=True)


if __name__ == "__main__":
    main()
