# SPDX-License-Identifier: GPL-3.0-or-later
"""Frame times of a city in the rows of seed 003's tables 7.1 to 7.6: every combination of its three effects, share of
the object, kinds and number of lights, resolution, moving lights.

The published figures are those of Haragăs 2023 on a GeForce RTX 2060 SUPER with a model of ancient Rome of 4 million
triangles. IS: indirect specular light, ours from the picture and, where that shows nothing, from the lamps' reflective
shadow maps. AO: ambient occlusion, ours from the camera and every map together. ID: indirect diffuse light by 200
static samples of each map, at every pixel. From table 7.2 on all three run. The city is that of sample_blends; all its
surfaces are glossy here, since the seed's reflect everywhere.

"ms" is the clock's time for a whole frame, from the scene's arrays to the picture's, without any display; all other
milliseconds of ours are those of all the processor's threads together where the renderer is software, since they mean
the same on a busy machine. Occlusion darkens indirect light alone here, so without ID it has nothing to do: in rows of
other effects without ID the gather runs, too, and its time is taken off. The columns of IS, AO and ID are those passes
alone. The last two are the gather of every fourth pixel with interpolation, and of the pattern of 10 samples that the
seed cites, once it has a history (where lamps move it has none, and takes all 200). Each is the least over the frames,
since other programs only ever add to it. Without options the city, the picture and the maps are small; --long takes the
published sizes.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.many_light import ProcessorTimer
from benchmarks.support import ROOT, quiet
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.core.scene import PRINCIPLED, SPOT, SUN, Float64, Light, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.passes.shadow_map import SINGLE_TILE_FACTOR
from vlm_addon.terminal import table

FULL_TRIANGLES = 4_000_000
IS, AO, ID = "IS", "AO", "ID"
ALL = (IS, AO, ID)
EFFECTS = {IS: ("screen_reflection", "map_reflection"), AO: ("ambient_occlusion",)}
PASSES = {
    ID: ("gather",),
    IS: ("screen reflection", "map reflection", "mix reflections"),
    AO: ("ambient occlusion",),
}
"""Of each effect, as the frame's timings name them."""
ROUGHNESS = 0.2
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


SHORT = Sizes(40_000, 0.1, 256, 5)
LONG = Sizes(FULL_TRIANGLES, 1.0, 2048, 5)


@dataclass(frozen=True)
class Row:
    """One row. published: frames per second and milliseconds. effects: that run. moving: lights that turn between
    frames."""

    label: str
    published: tuple[float, float]
    percent: float = HALF
    kinds: tuple[str, ...] = ORDER[:1]
    size: tuple[int, int] = SQUARE
    moving: int = 0
    effects: tuple[str, ...] = ALL


HEADS = (
    *("", "FPS published", "ms published", "FPS", "ms", "processor ms", "maps drawn"),
    *("ID ms", "IS ms", "AO ms", "ID of every 4th pixel", "ID 10 of 200"),
)
TABLES = {
    "7.1 algorithms": tuple(
        Row(" + ".join(effects) or "None", figures, 100.0, effects=effects)
        for effects, figures in (
            ((), (60.41, 16.60)),
            ((IS,), (60.35, 16.71)),
            ((AO,), (60.40, 16.61)),
            ((ID,), (23.99, 42.28)),
            ((IS, AO), (59.93, 16.98)),
            ((IS, ID), (18.47, 54.89)),
            ((AO, ID), (22.63, 44.77)),
            (ALL, (18.08, 56.00)),
        )
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
    """That share of a city of so many triangles, glossy all over, without its lights."""
    share = max(100.0 * triangles / FULL_TRIANGLES * percent / 100.0, 1e-3)
    build = ROOT / "sample_blends" / "build.py"
    with tempfile.TemporaryDirectory() as folder, quiet():
        command = [sys.executable, str(build), "city", "--percent", f"{share:.6f}", "--out", folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        open_scene(Path(folder) / "city.blend")
        snapshot = extract().snapshot
    looks = (replace(material, model=PRINCIPLED, roughness=ROUGHNESS) for material in snapshot.materials)
    return replace(snapshot, lights=(), materials=tuple(looks))


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
    """Milliseconds of a whole frame, by the clock and of all threads, and of the passes in it by name; maps it drew."""

    whole_ms: float
    processor_ms: float
    pass_ms: Mapping[str, float]
    drawn: int

    def of_effect(self, name: str) -> float:
        """Milliseconds of its passes."""
        return sum(self.pass_ms.get(each, 0.0) for each in PASSES[name])


def measured(device: Device, scene: SceneSnapshot, row: Row, sizes: Sizes, **values: object) -> Measured:
    """The least over the frames, and the last one's number of maps. values: settings of rsm_gather."""
    width, height = (max(round(side * sizes.scale), 1) for side in row.size)
    settings = RenderSettings(width, height, "direct", {}, 1, sizes.map_side, 1, effects=_effects(row.effects))
    if row.effects:
        values = {"resolution": sizes.map_side // SINGLE_TILE_FACTOR, **values}
        settings = replace(settings, technique="rsm_gather", technique_settings=values)
    around = lights(row.kinds, scene)
    times: list[tuple[float, float]] = []
    frames: list[Frame] = []
    for number in range(sizes.frames + 1):
        moved = tuple(turned(light, number) if i < row.moving else light for i, light in enumerate(around))
        started = time.perf_counter(), time.process_time()
        frames.append(device.render(replace(scene, lights=moved), None, settings))
        times.append((1e3 * (time.perf_counter() - started[0]), 1e3 * (time.process_time() - started[1])))
    passes = [dict(frame.timings) for frame in frames[1:]]
    least = {name: min(each.get(name, 0.0) for each in passes) for name in passes[0]}
    whole, processor = (min(each) for each in zip(*times[1:], strict=True))
    return Measured(whole, processor, least, int(frames[-1].counters.get("reflective_maps_drawn", 0)))


def _effects(chosen: tuple[str, ...]) -> dict[str, str]:
    """Which of the frame's effects run."""
    return {name: "on" if effect in chosen else "off" for effect, names in EFFECTS.items() for name in names}


def rows_of(name: str, device: Device, sizes: Sizes, cities: dict[float, SceneSnapshot]) -> list[tuple[str, ...]]:
    """The rows of one table as text."""
    return [_text_of(row, device, sizes, cities) for row in TABLES[name]]


def _text_of(row: Row, device: Device, sizes: Sizes, cities: dict[float, SceneSnapshot]) -> tuple[str, ...]:
    if row.percent not in cities:
        cities[row.percent] = city(row.percent, sizes.triangles)
    scene = cities[row.percent]
    found = measured(device, scene, row, sizes, low_resolution=1)
    unwanted = 0.0 if ID in row.effects else found.of_effect(ID)
    whole, processor = found.whole_ms - unwanted, found.processor_ms - unwanted
    published = f"{row.published[0]:.2f}", f"{row.published[1]:.2f}"
    parts = [f"{found.of_effect(effect):.1f}" if effect in row.effects else "" for effect in (ID, IS, AO)]
    gathers = ["", ""]
    if ID in row.effects:
        alone = replace(row, effects=(ID,))
        rivals = ({}, {"low_resolution": 1, "pattern": "rotating"})
        gathers = [f"{measured(device, scene, alone, sizes, **each).of_effect(ID):.1f}" for each in rivals]
    ours = f"{1e3 / whole:.2f}", f"{whole:.1f}", f"{processor:.1f}", str(found.drawn)
    return row.label, *published, *ours, *parts, *gathers


def main() -> None:
    """Prints the tables, all or those whose numbers are given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", action="store_true", help="the published sizes: a GPU is needed")
    parser.add_argument("--triangles", type=int, help="of the whole city")
    parser.add_argument("--scale", type=float, help="of the pictures' sides")
    parser.add_argument("--maps", type=int, help="texels along a map")
    parser.add_argument("--frames", type=int, help="that are measured, after one")
    parser.add_argument("tables", nargs="*", metavar="7.N", help="which tables (default: all)")
    chosen = parser.parse_args()
    base = LONG if chosen.long else SHORT
    sizes = Sizes(
        chosen.triangles or base.triangles,
        chosen.scale or base.scale,
        chosen.maps or base.map_side,
        chosen.frames or base.frames,
    )
    cities: dict[float, SceneSnapshot] = {}
    with Device() as device:
        if device.is_software:
            device.timer = lambda: ProcessorTimer(device.context, True, [])  # type: ignore[method-assign]
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
