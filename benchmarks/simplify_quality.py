# SPDX-License-Identifier: GPL-3.0-or-later
"""Error of the bounce from few lights against every source triangle as a light: ours against other simplifications.

`./dev bench simplify_quality [scene …] [--lights n …] [--lighting lamps|unit] [--out PNG]`. Irradiance by brute force
at 20,480 random points of the surface, whatever stands between, without tags. What each source triangle sends out is
found once, by phase one with the scene's lamps and shadows, or is its reflectance (`unit`): errors are those of
simplification alone. All get the same treatment: a light's radiosity is the mean over its region (ours: by the
collapses; the others': the nearest light that faces the same way), times the area of the region over its own, and it
is pushed behind its region. `as it is` columns: without the push, and without the areas made up for.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.scene_bounce import Bounce, spread_points, triangle_lights
from benchmarks.simplify_plot import draw
from benchmarks.simplify_rivals import RIVALS, Soup, joined, nearest_lights
from benchmarks.support import MODELS, SAMPLE_BLENDS, open_sample, quiet
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.core.hide_lights import hide_lights
from vlm_addon.core.light_mesh import VirtualLightMesh, empty_light_mesh
from vlm_addon.core.mesh_topology import Int64, sum_by
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.reduce_surface import ReducedSurface
from vlm_addon.core.regions import Regions
from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.core.simplify import STRENGTH_LIMIT, SimplifySettings, create_light_mesh
from vlm_addon.core.source_surface import SourceSurface, join_surface
from vlm_addon.render.device import Device
from vlm_addon.terminal import table

SCENES = ("monkey_box", "atrium", "bunny_box")
BUNNY = MODELS / "stanford-bunny.obj"
BUDGETS = (5000, 1000, 200, 50)
OURS = "ours"
TRIANGLE_SAMPLES = 4
HEADER = ("scene, budget", "way", "lights", "RMSE", "mean error", "99 %", "as it is: RMSE", "mean error", "s")


@dataclass(frozen=True)
class Row:
    """One way at one budget; errors relative to the mean irradiance."""

    scene: str
    budget: int
    way: str
    lights: int
    rmse: float
    mean_error: float
    quantile_99: float
    plain_rmse: float
    plain_mean: float
    seconds: float


@dataclass(frozen=True)
class Case:
    """A scene with what each of its triangles sends out, and the bounce of that."""

    name: str
    snapshot: SceneSnapshot
    surface: SourceSurface
    radiosity: Float64
    bounce: Bounce
    truth: Float64


def main() -> None:
    """Prints the table and draws the plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--lights", nargs="+", type=int, default=BUDGETS)
    parser.add_argument("--lighting", choices=("lamps", "unit"), default="lamps")
    parser.add_argument("--ways", nargs="+", default=(OURS, *RIVALS))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows: list[Row] = []
    with Device() as device:
        for name in options.scenes:
            if name == "bunny_box" and not BUNNY.exists():
                print("no shared models beside the checkout: bunny_box left out")
                continue
            case = prepared(device, name, options.lighting)
            for row in compared(case, options.lights, options.ways):
                rows.append(row)
                print(" ".join(_cells(row)), flush=True)
    print(table(HEADER, [_cells(row) for row in rows]))
    if options.out:
        what = "reflectance alone" if options.lighting == "unit" else "the scene's lamps"
        draw(options.out, rows, f"Bounce from few lights against every triangle as a light ({what})")


def snapshot_of(name: str) -> SceneSnapshot:
    """A sample scene, or the monkey's box with the bunny in it."""
    if name != "bunny_box":
        return open_sample(name).snapshot
    builder = SAMPLE_BLENDS / "build.py"
    with tempfile.TemporaryDirectory() as folder, quiet():
        command = [sys.executable, str(builder), "monkey_box", "--mesh", str(BUNNY), "--out", folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        open_scene(next(Path(folder).glob("*.blend")))
        return extract().snapshot


def prepared(device: Device, name: str, lighting: str) -> Case:
    """Opens the scene and sums all its triangles as lights."""
    snapshot = snapshot_of(name)
    surface = join_surface(snapshot.meshes)
    bounce = Bounce(device, snapshot, spread_points(snapshot))
    falling = bounce.falling(surface, TRIANGLE_SAMPLES) if lighting == "lamps" else np.ones((len(surface.areas), 3))
    radiosity = surface.emission + surface.reflectance * falling
    lit = surface.areas > 0
    truth = bounce.irradiance(triangle_lights(surface).subset(lit), radiosity[lit])
    return Case(name, snapshot, surface, radiosity, bounce, truth)


def compared(case: Case, budgets: Sequence[int], ways: Sequence[str]) -> Iterator[Row]:
    """A row for each budget and way."""
    soup = joined(case.snapshot.meshes)
    for budget in budgets:
        for way in ways:
            start = time.process_time()
            if way == OURS:
                created = create_light_mesh(case.snapshot.meshes, SimplifySettings(budget, 4))
                seconds = time.process_time() - start
                lights, region = created.light_mesh, np.concatenate(created.light_of_triangle)[case.surface.original]
                yield judged(case, budget, way, lights, region.astype(np.int64), None, seconds)
            else:
                points, triangles = RIVALS[way](soup, budget)
                seconds = time.process_time() - start
                region = nearest_lights(case.surface, (points, triangles))
                placed, own_region = _hidden(case.surface, (points, triangles), region)
                yield judged(case, budget, way, placed, own_region, (region, (points, triangles)), seconds)


def _hidden(surface: SourceSurface, soup: Soup, region: Int64) -> tuple[VirtualLightMesh, Int64]:
    """Another's lights placed as ours are, and their regions; it knows of no borders between materials."""
    one_group = replace(surface, group=np.zeros_like(surface.group))
    none = np.zeros(len(soup[1]), np.int64)
    lights = ReducedSurface(*soup, none, np.zeros(0, np.int64), False)
    hidden = hide_lights(one_group, lights, Regions(region, np.zeros(len(region), bool)), False)
    return _as_lights(hidden.positions, hidden.triangles), hidden.light


def judged(
    case: Case,
    budget: int,
    way: str,
    lights: VirtualLightMesh,
    region: Int64,
    plain: tuple[Int64, Soup] | None,
    seconds: float,
) -> Row:
    """Errors of lights with the mean radiosity of their regions; plain: regions and lights that nothing is made of."""
    mean, area = region_means(case, region, len(lights))
    strength = np.clip(area / lights.areas, 0.0, STRENGTH_LIMIT)
    radiosity = strength[:, None] * mean
    sent = case.surface.areas @ case.radiosity
    radiosity *= sent / (lights.areas @ radiosity)
    found = case.bounce.irradiance(lights, radiosity)
    plain_found = None
    if plain is not None:
        plain_found = case.bounce.irradiance(_as_lights(*plain[1]), region_means(case, plain[0], len(plain[1][1]))[0])
    return Row(
        case.name,
        budget,
        way,
        len(lights),
        relative_rmse(found, case.truth),
        _mean_error(found, case.truth),
        float(np.quantile(np.abs(found - case.truth).mean(axis=1), 0.99) / case.truth.mean()),
        relative_rmse(plain_found, case.truth) if plain_found is not None else np.nan,
        _mean_error(plain_found, case.truth) if plain_found is not None else np.nan,
        seconds,
    )


def region_means(case: Case, region: Int64, count: int) -> tuple[Float64, Float64]:
    """((n, 3) mean radiosity of each light's region, (n,) m² its area); 0 where it has none."""
    areas = case.surface.areas
    area = sum_by(region, areas, count)
    sums = [sum_by(region, case.radiosity[:, channel] * areas, count) for channel in range(3)]
    return np.stack(sums, axis=1) / np.where(area > 0, area, 1.0)[:, None], area


def _as_lights(points: Float64, triangles: Int64) -> VirtualLightMesh:
    count = len(triangles)
    return replace(
        empty_light_mesh(),
        vertices=points,
        triangles=triangles.astype(np.int32),
        colour=np.ones((count, 3), np.float32),
        emission=np.zeros((count, 3), np.float32),
        strength=np.ones(count, np.float32),
        tag_ids=np.zeros(count, np.int32),
        dynamic=np.zeros(count, bool),
    )


def _mean_error(found: Float64, truth: Float64) -> float:
    return float(np.abs(found - truth).mean() / truth.mean())


def _cells(row: Row) -> tuple[str, ...]:
    plain = ("", "") if np.isnan(row.plain_rmse) else (f"{row.plain_rmse:.2%}", f"{row.plain_mean:.2%}")
    return (
        f"{row.scene}, {row.budget:,}",
        row.way,
        f"{row.lights:,}",
        f"{row.rmse:.2%}",
        f"{row.mean_error:.2%}",
        f"{row.quantile_99:.2%}",
        *plain,
        f"{row.seconds:.1f}",
    )


if __name__ == "__main__":
    main()
