# SPDX-License-Identifier: GPL-3.0-or-later
"""The two tables of seed 001 for our scenes, beside the published figures: numbers of lights, and low resolution.

`./dev bench second_order` takes monkey_box at 160 x 120; `--size 640x480` is what was published, and `--mesh` puts the
Stanford bunny in the monkey's place where ../shared/models has it. A frame is one sample of every pixel. Its time is
that of all passes but the upload of the geometry; "processor" is that of all threads in the gather, which means the
same on a busy machine (on a GPU it means nothing). Of --runs frames the one with the least of that counts. Errors are
against the same frame gathered at every pixel: of the displayed picture (sRGB, of its whole range, as the published
figure may be meant) and, which is stricter, of the indirect light alone (relative RMSE).

The low resolution is tested as published, by normal and position, and with the test of neighbours' results that we add;
of each, thresholds are looked for that leave the share of pixels that was published.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.simplify import load_model
from benchmarks.support import MODELS, open_sample
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import Float64, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.images import srgb_encoded
from vlm_addon.render.passes.low_resolution import LowResolutionGather
from vlm_addon.terminal import table

SCENE = "monkey_box"
REPLACED = "Monkey"
BUNNY = "stanford-bunny.obj"
TECHNIQUE = "second_order"
SHADOW_RESOLUTION = 512
NOT_IN_A_FRAME = ("geometry", "read back")
SEARCH_STEPS = 7

PUBLISHED_FPS = {(100, 50): 26.5, (150, 0): 32.6, (200, 100): 15.6, (300, 0): 19.2, (300, 150): 11.0, (450, 0): 13.6}
"""Seed 001, table 1: a Quadro FX 5500, the bunny in a box at 640 x 480; by indirect and negative lights."""
PUBLISHED_SHARES = {1.0: (1.5082, 42.5), 0.875: (0.1688, 26.5), 0.5: (0.0885, 15.4), 0.0: (0.0, 12.6)}
"""Seed 001, table 2: RMS in percent and frames a second, by share of pixels at low resolution; 100 and 50 lights."""
PUBLISHED_LIGHTS = {"indirect_lights": 100, "negative_lights": 50}
ALL_LOW = {"normal_threshold": 3.0, "position_threshold": 1e6, "value_threshold": 2.0}
TESTS: dict[str, tuple[dict[str, float], str, tuple[float, float]]] = {
    "normal and position": ({"value_threshold": 2.0}, "position_threshold", (1e-3, 1.0)),
    "and results": ({}, "value_threshold", (1e-3, 2.0)),
}
"""Settings of each test, and the threshold that is looked for, with the range in which."""


@dataclass(frozen=True)
class Timed:
    """A frame, and the processor milliseconds of its gather."""

    frame: Frame
    processor: float

    @property
    def gather(self) -> float:
        """Milliseconds of the gather."""
        return dict(self.frame.timings)["gather"]

    @property
    def whole(self) -> float:
        """Milliseconds of the frame."""
        return sum(ms for name, ms in self.frame.timings if name not in NOT_IN_A_FRAME)

    @property
    def share(self) -> float:
        """Of the pixels that show a surface, those that the low resolution did for."""
        return self.frame.counters["low_resolution_share"]


class Frames:
    """Frames of one scene on one device, the fastest of some."""

    def __init__(self, device: Device, scene: SceneSnapshot, size: tuple[int, int], runs: int) -> None:
        self._device = device
        self._scene = scene
        self._size = size
        self._runs = runs
        # Compiles shaders and draws the maps, which are kept.
        self._render((16, 12), {})
        self._render(size, ALL_LOW)

    def once(self, values: Mapping[str, float]) -> Timed:
        """One frame with these settings."""
        return self._render(self._size, values)

    def fastest(self, variants: Sequence[Mapping[str, float]]) -> list[Timed]:
        """For each of the settings the frame of some with the least processor time.

        All take turns, so that what else the machine does slows all down alike.
        """
        rounds = [[self.once(values) for values in variants] for _ in range(self._runs)]
        return [min(frames, key=lambda each: each.processor) for frames in zip(*rounds, strict=True)]

    def _render(self, size: tuple[int, int], values: Mapping[str, float]) -> Timed:
        settings = RenderSettings(*size, TECHNIQUE, values, 1, SHADOW_RESOLUTION, 1)
        render, milliseconds = LowResolutionGather.render, []

        def clocked(*inputs: object) -> object:
            self._device.context.finish()
            start = time.process_time()
            result = render(*inputs)  # type: ignore[arg-type]
            self._device.context.finish()
            milliseconds.append(1e3 * (time.process_time() - start))
            return result

        LowResolutionGather.render = clocked  # type: ignore[method-assign,assignment]
        try:
            frame = self._device.render(self._scene, None, settings)
        finally:
            LowResolutionGather.render = render  # type: ignore[method-assign]
        return Timed(frame, sum(milliseconds))


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="160x120")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--mesh", action="store_true", help="the bunny in the monkey's place")
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    scene = open_sample(SCENE).snapshot
    if options.mesh and not (MODELS / BUNNY).exists():
        print(f"no {BUNNY} in {MODELS.parent.name}/{MODELS.name}: left out")
        return
    scene = with_bunny(scene) if options.mesh else scene
    with Device() as device:
        frames = Frames(device, scene, (width, height), options.runs)
        name = f"{SCENE} with {BUNNY}" if options.mesh else SCENE
        print(f"{device.name}; {platform.processor() or platform.machine()}; {name}, {width} x {height}")
        print("\nNumbers of lights (001, table 1)")
        print(light_table(frames))
        print("\nLow resolution, 100 and 50 lights (001, table 2)")
        print(resolution_table(frames))


def light_table(frames: Frames) -> str:
    """Table 1."""
    variants = [{"indirect_lights": positive, "negative_lights": negative} for positive, negative in PUBLISHED_FPS]
    rows = [
        (
            str(chosen["indirect_lights"]),
            str(chosen["negative_lights"]),
            f"{found.share:.1%}",
            f"{found.gather:,.1f}",
            f"{found.processor:,.0f}",
            f"{1e3 / found.whole:.1f}",
            f"{published:.1f}",
        )
        for chosen, found, published in zip(variants, frames.fastest(variants), PUBLISHED_FPS.values(), strict=True)
    ]
    return table(("lights", "negative", "low", "gather ms", "processor", "frames/s", "published"), rows)


def resolution_table(frames: Frames) -> str:
    """Table 2, for each test."""
    variants: list[tuple[str, float, dict[str, float]]] = [("", 0.0, {**PUBLISHED_LIGHTS, "low_resolution": 1})]
    for name, (values, threshold, limits) in TESTS.items():
        for share in (0.5, 0.875):
            chosen = {**PUBLISHED_LIGHTS, **values}
            chosen[threshold] = search(lambda value, c=chosen, t=threshold: frames.once({**c, t: value}), share, limits)
            variants.append((f"{name}: {chosen[threshold]:.3f}", share, chosen))
    variants.append(("none", 1.0, {**PUBLISHED_LIGHTS, **ALL_LOW}))
    found = frames.fastest([chosen for _, _, chosen in variants])
    rows = [row(name, each, found[0], share) for (name, share, _), each in zip(variants, found, strict=True)]
    header = ("test", "low", "picture RMS", "published", "indirect RMS", "gather ms", "processor", "faster")
    return table((*header, "frames/s", "published"), rows)


def search(measured: Callable[[float], Timed], share: float, limits: tuple[float, float]) -> float:
    """The threshold at which about `share` of the pixels are left to the low resolution, which grows with it."""
    low, high = np.log(limits)
    for _ in range(SEARCH_STEPS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if measured(float(np.exp(middle))).share > share else (middle, high)
    return float(np.exp(0.5 * (low + high)))


def row(name: str, found: Timed, full: Timed, share: float) -> tuple[str, ...]:
    """Of table 2. share: that was published."""
    rms, fps = PUBLISHED_SHARES[share]
    error = srgb_encoded(found.frame.images["combined"][..., :3]) - displayed(full)
    return (
        name,
        f"{found.share:.1%}",
        f"{np.sqrt((error**2).mean()):.4%}",
        f"{rms:.4f}%",
        f"{relative_rmse(found.frame.images['indirect'], full.frame.images['indirect']):.2%}",
        f"{found.gather:,.1f}",
        f"{found.processor:,.0f}",
        f"{full.processor / found.processor:.2f}",
        f"{1e3 / found.whole:.1f}",
        f"{fps:.1f}",
    )


def displayed(timed: Timed) -> Float64:
    """The picture as an eye would see it, in [0, 1]."""
    return srgb_encoded(timed.frame.images["combined"][..., :3])


def with_bunny(scene: SceneSnapshot) -> SceneSnapshot:
    """`scene` with the bunny where the monkey is, in its material, as high as that and as far above the floor."""
    monkey = next(mesh for mesh in scene.meshes if mesh.name == REPLACED)
    bunny = load_model(MODELS / BUNNY)
    # The model's y axis points up.
    upright = bunny.positions[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    low, high = upright.min(axis=0), upright.max(axis=0)
    monkey_low, monkey_high = monkey.positions.min(axis=0), monkey.positions.max(axis=0)
    scale = (monkey_high - monkey_low)[2] / (high - low)[2]
    positions = (upright - 0.5 * (low + high)) * scale + 0.5 * (monkey_low + monkey_high)
    count = len(bunny.triangles)
    placed = replace(
        bunny,
        positions=positions,
        corner_normals=smooth_normals(positions, bunny),
        material_indices=np.full(count, monkey.material_indices[0], np.int32),
        reflectance=np.tile(monkey.reflectance[:1], (count, 1)),
    )
    return replace(scene, meshes=(*(mesh for mesh in scene.meshes if mesh.name != REPLACED), placed))


def smooth_normals(positions: Float64, mesh: Mesh) -> np.ndarray:
    """(t, 3, 3) float32: at each corner the mean of the faces around its vertex, by area."""
    corners = positions[mesh.triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(positions)
    for corner in range(3):
        np.add.at(sums, mesh.triangles[:, corner], faces)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return (sums / np.maximum(lengths, 1e-30))[mesh.triangles].astype(np.float32)


if __name__ == "__main__":
    main()
