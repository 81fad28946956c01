# SPDX-License-Identifier: GPL-3.0-or-later
"""Light trees of the atrium: what a point costs, and how far it is from the full sum.

`./dev bench light_tree [lights …] [--points n]`. Errors are point errors (README) at random points of the visible
surface, under smooth radiosity and under two spot lamps that light a patch each. `evaluated` counts form factors and
cluster formulas computed for a point, `visited` all lights and clusters met on the way, most of which turn out to face
away, to lie under the horizon or to be dark. Milliseconds are those of the processor, the least of three times; what
is measured is what renderers do: `build` is the tree, `relight` the scale, the factor of the windows and the clusters.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.light_clusters import LightClusters, light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.light_scale import PROBES, mean_irradiance
from vlm_addon.core.light_tree import LightTree, build_light_tree
from vlm_addon.core.light_tree_error import PointErrors, full_irradiance
from vlm_addon.core.metrics import point_error
from vlm_addon.core.scene import Float64
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.surface_points import SurfacePoints, random_surface_points
from vlm_addon.core.window_factor import window_factor
from vlm_addon.terminal import table

T = TypeVar("T")

SCENE = "atrium"
LIGHTS, TOLERANCES, POINTS = (1_000, 10_000, 100_000), (0.01, 0.02, 0.05, 0.1), 1000
LAMPS = {
    "lamp": ((3.0, 0.0, 6.0), (1.0, -1.0, 0.5), 0.97),
    "small lamp": ((0.0, 0.0, 2.5), (0.3, 1.0, -0.05), 0.97),
}
"""Place, direction and cosine of the half angle of each spot."""
HEADER = (
    "lights, radiosity",
    "lit",
    "tolerance",
    "evaluated",
    "visited",
    "most",
    "95th %",
    "99.9th %",
    "windows x",
    "build ms",
    "relight ms",
    "MB",
)


@dataclass(frozen=True)
class Row:
    """One setting: how many lights are lit, errors, the most evaluations at a point, and the factor of windows."""

    lights: int
    radiosity: str
    lit: int
    tolerance: float
    errors: PointErrors
    most_evaluated: int
    factor: float
    build_ms: float
    relight_ms: float
    nbytes: int


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lights", nargs="*", type=int, default=LIGHTS)
    parser.add_argument("--points", type=int, default=POINTS)
    options = parser.parse_args()
    rows = [_cells(row) for row in campaign(options.lights, options.points)]
    print(table(HEADER, rows))


def campaign(lights: Sequence[int], points: int, tolerances: Sequence[float] = TOLERANCES) -> Iterator[Row]:
    """Every number of lights, radiosity and tolerance."""
    meshes = open_sample(SCENE).snapshot.meshes
    # Not the points at which windows and scale are found.
    at, probes = random_surface_points(meshes, points, seed=1), random_surface_points(meshes, PROBES)
    for count in lights:
        light_mesh = create_light_mesh(meshes, SimplifySettings(count, 1)).light_mesh
        yield from rows(light_mesh, radiosities(light_mesh), at, probes, tolerances)


def radiosities(light_mesh: VirtualLightMesh) -> dict[str, Float64]:
    """(n,) W/m² of each light: smooth, and under each lamp. Lamps that miss every light are left out."""
    centroids = light_mesh.corners.mean(axis=1)
    colour = light_mesh.colour.astype(np.float64).sum(axis=1)
    normals = light_mesh.area_vectors / np.maximum(light_mesh.areas, np.finfo(float).tiny)[:, None]
    found = {"smooth": colour * (1.0 + 0.5 * np.sin(centroids @ [0.3, 0.2, 0.4]))}
    for name, (place, direction, half_angle) in LAMPS.items():
        away = np.array(place) - centroids
        distance = np.linalg.norm(away, axis=1)
        away /= distance[:, None]
        along = -(away @ np.array(direction)) / np.linalg.norm(direction)
        cone = np.clip((along - half_angle) / (0.3 * (1.0 - half_angle)), 0.0, 1.0)
        found[name] = colour * cone * np.maximum((normals * away).sum(axis=1), 0.0) / distance**2
    return {name: values for name, values in found.items() if values.any()}


def rows(
    light_mesh: VirtualLightMesh,
    lightings: dict[str, Float64],
    at: SurfacePoints,
    probes: SurfacePoints,
    tolerances: Sequence[float],
) -> Iterator[Row]:
    """Of one light mesh. The radiosities are the channels of one full sum."""
    tags = np.zeros(len(at.positions), np.int32)
    channels = np.zeros((len(light_mesh), 3))
    channels[:, : len(lightings)] = np.stack(list(lightings.values()), axis=1)
    full = full_irradiance(light_mesh, channels, at.positions, at.normals, tags)
    tree, build_ms = best(lambda: build_light_tree(light_mesh))
    for channel, (name, values) in enumerate(lightings.items()):
        radiosity = np.column_stack([values, np.zeros((len(values), 2))])
        for tolerance in tolerances:
            relight = partial(relit, tree, light_mesh, radiosity, tolerance, probes)
            (clusters, factor), relight_ms = best(relight)
            cut = cut_irradiance(tree, clusters, light_mesh, radiosity, at.positions, at.normals, tags)
            errors = point_error(cut.irradiance[:, 0], full[:, channel])
            yield Row(
                lights=len(light_mesh),
                radiosity=name,
                lit=int((values > 0.0).sum()),
                tolerance=tolerance,
                errors=PointErrors(errors, float(cut.evaluated.mean()), float(cut.visited.mean())),
                most_evaluated=int(cut.evaluated.max()),
                factor=factor,
                build_ms=build_ms,
                relight_ms=relight_ms,
                nbytes=tree.nbytes + clusters.nbytes,
            )


def relit(
    tree: LightTree,
    light_mesh: VirtualLightMesh,
    radiosity: Float64,
    tolerance: float,
    probes: SurfacePoints,
) -> tuple[LightClusters, float]:
    """As renderers relight; and the factor of the windows."""
    mean = mean_irradiance([tree], light_mesh, radiosity, probes)
    factor = window_factor([tree], light_mesh, radiosity, tolerance, mean, probes)
    return light_clusters(tree, light_mesh, radiosity, tolerance, mean, factor), factor


def best(work: Callable[[], T]) -> tuple[T, float]:
    """What `work` returns and its least processor milliseconds of three times."""
    times = []
    for _ in range(3):
        started = time.process_time()
        result = work()
        times.append(1000.0 * (time.process_time() - started))
    return result, min(times)


def _cells(row: Row) -> tuple[str, ...]:
    return (
        f"{row.lights:,}, {row.radiosity}",
        f"{row.lit:,}",
        f"{row.tolerance:.0%}",
        f"{row.errors.evaluated:.0f}",
        f"{row.errors.visited:.0f}",
        f"{row.most_evaluated}",
        f"{100 * row.errors.quantile(0.95):.2f}",
        f"{100 * row.errors.quantile(0.999):.2f}",
        f"{row.factor:.2f}",
        f"{row.build_ms:.0f}",
        f"{row.relight_ms:.0f}",
        f"{1e-6 * row.nbytes:.2f}",
    )


if __name__ == "__main__":
    main()
