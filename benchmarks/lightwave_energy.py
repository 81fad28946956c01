# SPDX-License-Identifier: GPL-3.0-or-later
"""How much light LightWave brings to the walls of empty_room, against one diffuse bounce.

In the empty room nothing occludes: all that the walls reflect arrives on them once more. Each wall is looked at square
on, so that the mean over its pixels is the mean over the wall. LightWave knows no reflectance and no distance: the
ratio is what its rules make it, and changes with every parameter.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from benchmarks.support import open_sample
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.scene import AREA, ORTHOGRAPHIC, POINT, SPOT, Camera, Float64, Light, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.terminal import table

PIXELS_PER_METRE = 16
GRID_STEPS = 60
WATTS = (45.0, 45.0, 45.0)
LAMPS = (
    Light("point in the middle", POINT, WATTS, (0.0, 0.0, 0.0)),
    Light("point near the ceiling", POINT, WATTS, (0.4, -0.3, 0.9)),
    Light("spot", SPOT, WATTS, (0.5, 0.2, 0.9), spot_angle=1.5, spot_blend=0.3),
    Light("area under the ceiling", AREA, WATTS, (0.0, 0.0, 1.2), size_x=1.0, size_y=0.8),
)
VARIANTS: Mapping[str, Mapping[str, object]] = {
    "default, no shadows": {},
    "at pixels": {"computed_at": "pixels", "angle": 10.0},
    "30 degrees": {"angle": 30.0},
    "1 on a ray": {"shells": 1},
    "6 on a ray": {"shells": 6},
    "half the reach": {"reach": 0.5},
}


def face_of(wall: Mesh) -> tuple[Float64, Float64, Float64, npt.NDArray[np.intp]]:
    """Lower and upper corner of a wall along two axes, its normal, and those axes."""
    low, high = wall.positions.min(axis=0), wall.positions.max(axis=0)
    normal = wall.corner_normals[0, 0].astype(float)
    return low, high, normal, (np.argmax(np.abs(normal)) + np.array([1, 2])) % 3


def wall_mean(
    device: Device, scene: SceneSnapshot, wall: Mesh, settings: Mapping[str, object]
) -> tuple[Float64, float]:
    """Mean irradiance of a wall, (3,) W/m², and its area, m²."""
    low, high, normal, across = face_of(wall)
    width, height = (high - low)[across]
    matrix = np.eye(4)
    matrix[:3, 0] = np.eye(3)[across[0]]
    matrix[:3, 2] = normal
    matrix[:3, 1] = np.cross(normal, matrix[:3, 0])
    matrix[:3, 3] = 0.5 * (low + high) + 0.5 * normal
    camera = Camera("wall", matrix, ORTHOGRAPHIC, ortho_scale=max(width, height), clip_start=1e-3)
    size = (round(PIXELS_PER_METRE * width), round(PIXELS_PER_METRE * height))
    values = {"shadows": "none", **settings}
    rendered = device.render(
        replace(scene, camera=camera), None, RenderSettings(*size, "lightwave", values, 1, 16, 1, buffers=True)
    )
    return rendered.images["irradiance"].reshape(-1, 3).mean(axis=0, dtype=float), float(width * height)


def reflected(scene: SceneSnapshot, wall: Mesh) -> Float64:
    """(3,) W that a wall reflects of its lamps, summed over a grid of points."""
    low, high, normal, across = face_of(wall)
    steps = (np.arange(GRID_STEPS) + 0.5) / GRID_STEPS
    points = np.tile(low, (GRID_STEPS**2, 1))
    points[:, across] += np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * (high - low)[across]
    normals = np.tile(normal, (len(points), 1))
    received = sum(lamp_irradiance(light, points, normals) for light in scene.lights)
    return np.asarray(wall.reflectance[0] * np.mean(received, axis=0) * np.prod((high - low)[across]))


def main() -> None:
    """Prints a row for each lamp and variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    room = open_sample("empty_room").snapshot
    rows = []
    with Device() as device:
        for light in LAMPS:
            scene = replace(room, lights=(light,))
            for name, settings in VARIANTS.items() if light is LAMPS[0] else (next(iter(VARIANTS.items())),):
                means, areas = zip(*(wall_mean(device, scene, wall, settings) for wall in scene.meshes), strict=True)
                truth = np.sum([reflected(scene, wall) for wall in scene.meshes], axis=0) / sum(areas)
                found = np.average(means, axis=0, weights=areas)
                spread = np.ptp([mean.mean() for mean in means]) / found.mean()
                ratio = found / truth
                cells = [f"{value:.3f}" for value in (found.mean(), truth.mean(), *ratio, spread)]
                rows.append((light.name, name, *cells))
    print(table(("lamp", "variant", "W/m²", "one bounce", "red", "green", "blue", "wall to wall"), rows))
    print("red, green, blue: light over that of one bounce. wall to wall: brightest less darkest wall over the mean.")


if __name__ == "__main__":
    main()
