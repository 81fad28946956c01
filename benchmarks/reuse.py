# SPDX-License-Identifier: GPL-3.0-or-later
"""What a frame costs after an edit, where the device keeps what it can and where it makes everything anew.

`./dev bench reuse [scenes …]` renders each scene with --technique after each of some edits: nothing, the camera moved,
a lamp moved, a lamp dimmed, an object moved, a material painted. It prints the milliseconds of the frame with what was
kept, those of the same frame with nothing kept, how many of the former went into hashes, and what was made anew:
processor time of all threads, which means the same on a busy machine, or --clock wall on a GPU. Both pictures must be
the same to the bit. Arrays are copied before each frame, so that nothing is known by who it is. `mesh:N` instead of a
sample is a wavy sheet of N triangles under two lamps. A sample without light mesh gets one of --lights lights.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import DIFFUSE, POINT, SPOT, Camera, Light, Material, Mesh, SceneSnapshot
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.render.device import Device
from vlm_addon.render.digests import Digests
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.kept import Kept
from vlm_addon.terminal import table

SHEET = "mesh:"
CLOCKS = {"processor": time.process_time, "wall": time.perf_counter}
STEP = 0.05
"""Of the scene's diagonal, what moves."""

HEADS = ("edit", "frame ms", "all anew ms", "hashes ms", "hashed MB", "made anew")

Edit = Callable[[SceneSnapshot], SceneSnapshot]


def main() -> None:
    """Prints a table for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["atrium", f"{SHEET}1000000"])
    parser.add_argument("--technique", default="vlm")
    parser.add_argument("--size", default="160x90")
    parser.add_argument("--samples", type=int, default=1)
    parser.add_argument("--shadow-resolution", type=int, default=512)
    parser.add_argument("--world-lights", type=int, default=8)
    parser.add_argument("--shadow-samples", type=int, default=32)
    parser.add_argument("--lights", type=int, default=1000)
    parser.add_argument("--clock", choices=CLOCKS, default="processor")
    options = parser.parse_args()
    with Device() as device:
        print(f"{device.name}; {platform.processor() or platform.machine()}")
        for name in options.scenes:
            scene, lights = _scene(name, options.lights)
            technique = options.technique if lights is not None else "direct"
            settings = _settings(technique, options)
            print(f"\n{name}: {scene.triangle_count:,} triangles, {len(scene.lights)} lamps, {technique}")
            rows = Rows(device, scene, lights, settings, CLOCKS[options.clock])
            print(table(HEADS, list(rows)), flush=True)


def _settings(technique: str, options: argparse.Namespace) -> RenderSettings:
    width, height = (int(side) for side in options.size.split("x"))
    return RenderSettings(
        width,
        height,
        technique,
        samples=options.samples,
        shadow_resolution=options.shadow_resolution,
        shadow_samples=options.shadow_samples,
        world_lights=options.world_lights,
    )


class TimedDigests(Digests):
    """seconds: that hashes took; nbytes: of the arrays that were read."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self.seconds = 0.0
        self.nbytes = 0

    def of(self, *values: Any) -> str:
        """As in Digests."""
        started = self._clock()
        found = super().of(*values)
        self.seconds += self._clock() - started
        if self._remembered is not None:
            self.nbytes = sum(array.nbytes for array, _ in self._remembered.values())
        return found


@dataclass(frozen=True)
class Rows:
    """Of the table of one scene, one for each edit."""

    device: Device
    scene: SceneSnapshot
    lights: VirtualLightMesh | None
    settings: RenderSettings
    clock: Callable[[], float]

    def __iter__(self) -> Iterator[tuple[str, ...]]:
        self.device.kept = Kept()
        self._render(self.scene)
        edits: dict[str, Edit] = {"nothing": lambda scene: scene, "camera moves": _camera_moved}
        if self.scene.lights:
            edits |= {"lamp moves": _lamp_moved, "lamp is dimmed": _lamp_dimmed}
        edits |= {"object moves": _object_moved, "material is painted": _painted}
        for name, edit in edits.items():
            # From the same scene each time.
            self._render(self.scene)
            edited = edit(self.scene)
            digests = self.device.kept.digests = TimedDigests(self.clock)
            frame, milliseconds = self._timed(edited)
            events = self.device.kept.events()
            built = ", ".join(f"{kind} {reuse.built}" for kind, reuse in events.items() if reuse.built)
            anew, all_anew = self._anew(edited)
            assert all((image == anew.images[key]).all() for key, image in frame.images.items()), name
            figures = (milliseconds, all_anew, 1e3 * digests.seconds, 1e-6 * digests.nbytes)
            yield name, *(f"{figure:,.0f}" for figure in figures), built or "nothing"

    def _anew(self, scene: SceneSnapshot) -> tuple[Frame, float]:
        kept, self.device.kept = self.device.kept, Kept()
        try:
            return self._timed(scene)
        finally:
            self.device.kept = kept

    def _timed(self, scene: SceneSnapshot) -> tuple[Frame, float]:
        scene, started = _copied(scene), self.clock()
        frame = self.device.render(scene, self.lights, self.settings)
        return frame, 1e3 * (self.clock() - started)

    def _render(self, scene: SceneSnapshot) -> None:
        self.device.render(_copied(scene), self.lights, self.settings)


def _copied(scene: SceneSnapshot) -> SceneSnapshot:
    return replace(scene, meshes=tuple(_copied_mesh(mesh) for mesh in scene.meshes))


def _copied_mesh(mesh: Mesh) -> Mesh:
    values = {field.name: getattr(mesh, field.name) for field in fields(mesh)}
    arrays: dict[str, Any] = {name: value.copy() for name, value in values.items() if isinstance(value, np.ndarray)}
    return replace(mesh, **arrays)


def _step(scene: SceneSnapshot) -> float:
    low, high = scene.bounds()
    return STEP * float(np.linalg.norm(high - low))


def _camera_moved(scene: SceneSnapshot) -> SceneSnapshot:
    assert scene.camera is not None
    matrix = scene.camera.matrix_world.copy()
    matrix[:3, 3] += _step(scene) * matrix[:3, 0]
    return replace(scene, camera=replace(scene.camera, matrix_world=matrix))


def _lamp_moved(scene: SceneSnapshot) -> SceneSnapshot:
    x, y, z = scene.lights[0].position
    # Turned a little about the vertical, for a sun.
    axes = np.array([scene.lights[0].x_axis, scene.lights[0].y_axis, scene.lights[0].z_axis])
    turn = np.array([[np.cos(STEP), np.sin(STEP), 0.0], [-np.sin(STEP), np.cos(STEP), 0.0], [0.0, 0.0, 1.0]])
    x_axis, y_axis, z_axis = (tuple(axis) for axis in (axes @ turn).tolist())
    moved = replace(scene.lights[0], position=(x + _step(scene), y, z), x_axis=x_axis, y_axis=y_axis, z_axis=z_axis)
    return replace(scene, lights=(moved, *scene.lights[1:]))


def _lamp_dimmed(scene: SceneSnapshot) -> SceneSnapshot:
    red, green, blue = scene.lights[0].power
    dimmed = replace(scene.lights[0], power=(0.5 * red, 0.5 * green, 0.5 * blue))
    return replace(scene, lights=(dimmed, *scene.lights[1:]))


def _object_moved(scene: SceneSnapshot) -> SceneSnapshot:
    """The smallest object, towards the middle, so that the bounds of the scene stay."""
    low, high = scene.bounds()
    index = min(range(len(scene.meshes)), key=lambda row: float(np.prod(np.ptp(scene.meshes[row].positions, axis=0))))
    mesh = scene.meshes[index]
    way = 0.5 * (low + high) - mesh.positions.mean(axis=0)
    moved = replace(mesh, positions=mesh.positions + 0.1 * way)
    return replace(scene, meshes=(*scene.meshes[:index], moved, *scene.meshes[index + 1 :]))


def _painted(scene: SceneSnapshot) -> SceneSnapshot:
    return replace(scene, materials=(replace(scene.materials[0], base_color=(0.9, 0.1, 0.1)), *scene.materials[1:]))


def _scene(name: str, lights: int) -> tuple[SceneSnapshot, VirtualLightMesh | None]:
    """A sample and its light mesh, or a sheet of so many triangles."""
    if not name.startswith(SHEET):
        found = open_sample(name)
        made = found.light_mesh or create_light_mesh(found.snapshot.meshes, SimplifySettings(lights)).light_mesh
        return found.snapshot, made
    side = round((int(name.removeprefix(SHEET)) / 2) ** 0.5)
    lamps = (
        Light("point", POINT, (50.0, 50.0, 50.0), (0.0, 0.0, 2.5)),
        Light("spot", SPOT, (50.0, 50.0, 50.0), (1.0, 0.0, 2.5), radius=0.1),
    )
    matrix = np.array([[1, 0, 0, 0], [0, 0.5, -0.866, -5], [0, 0.866, 0.5, 3], [0, 0, 0, 1]], float)
    camera, materials = Camera("camera", matrix), (Material("sheet", DIFFUSE, (0.5, 0.5, 0.5)),)
    return SceneSnapshot("sheet", (_sheet(side),), materials, lights=lamps, camera=camera), None


def _sheet(side: int) -> Mesh:
    """Of side x side squares, 6 m wide."""
    x, y = np.meshgrid(np.linspace(-3.0, 3.0, side + 1), np.linspace(-3.0, 3.0, side + 1))
    positions = np.stack([x, y, 0.1 * np.sin(5.0 * x) * np.cos(4.0 * y)], axis=-1).reshape(-1, 3)
    first = np.arange(side * (side + 1)).reshape(side, side + 1)[:, :-1].ravel()
    beside, above, across = first + 1, first + side + 1, first + side + 2
    lower, upper = np.stack([first, beside, across], axis=-1), np.stack([first, across, above], axis=-1)
    triangles = np.concatenate([lower, upper]).astype(np.int32)
    count = len(triangles)
    return Mesh(
        name="sheet",
        positions=positions,
        triangles=triangles,
        corner_normals=np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), (count, 3, 3)).copy(),
        corner_uvs=positions[triangles][..., :2].astype(np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.zeros(count, np.int32),
        tag_ids=np.zeros(count, np.int32),
        reflectance=np.full((count, 3), 0.5, np.float32),
        emission=np.zeros((count, 3), np.float32),
    )


if __name__ == "__main__":
    main()
