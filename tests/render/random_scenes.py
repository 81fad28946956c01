# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms with random lamps, materials, light meshes, things and motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tests.render.closed_rooms import inward_box
from tests.render.rooms import camera_at, lights_from_triangles, quad, split
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import (
    AREA,
    DIFFUSE,
    POINT,
    PRINCIPLED,
    SPOT,
    SUN,
    Light,
    Material,
    Mesh,
    SceneSnapshot,
)

TECHNIQUES = (
    ("vlm", {"lights": "all"}),
    ("vlm", {"lights": "tolerance"}),
    ("vlm", {"lights": "all", "visibility": "octree", "octree_resolution": 64}),
    ("vlm", {"lights": "range", "range": 100.0, "max_lights": 4096}),
    ("rsm_gather", {"samples": 20}),
    ("direct", {}),
)
CHANGES = ("nothing", "lamp", "thing", "camera", "colour")
FRAMES = 3


@dataclass(frozen=True)
class Shot:
    """One frame of a random scene. changed: what is other than in the frame before."""

    snapshot: SceneSnapshot
    light_mesh: VirtualLightMesh
    changed: str


@dataclass(frozen=True)
class RandomScene:
    """A technique with its settings, and what it is to show."""

    technique: str
    settings: dict[str, object]
    shots: tuple[Shot, ...]


def random_scene(seed: int) -> RandomScene:
    """A scene of FRAMES frames; the same for the same seed."""
    random = np.random.default_rng(seed)
    technique, settings = TECHNIQUES[seed % len(TECHNIQUES)]
    snapshot = _scene(random)
    lights = _lights(random, snapshot)
    shots = [Shot(snapshot, lights, "all")]
    for _ in range(FRAMES - 1):
        shots.append(_changed(random, shots[-1]))
    return RandomScene(technique, dict(settings), tuple(shots))


def _scene(random: np.random.Generator) -> SceneSnapshot:
    materials = tuple(_material(random, index) for index in range(4))
    walls = inward_box((-2, -2, -1), (2, 2, 1), random.integers(0, 4, 6).tolist())
    if random.random() < 0.3:
        walls = walls[4:5]
    meshes = [*walls, *_things(random)]
    if random.random() < 0.4:
        chosen = int(random.integers(len(meshes)))
        tags = np.full(len(meshes[chosen].triangles), 3, np.int32)
        meshes[chosen] = replace(meshes[chosen], tag_ids=tags)
    world = tuple((random.random(3) * 0.5).tolist()) if random.random() < 0.25 else (0.0, 0.0, 0.0)
    return SceneSnapshot(
        "random",
        tuple(_with_light(mesh, materials) for mesh in meshes),
        materials,
        lights=tuple(_lamps(random)),
        camera=camera_at((-1.7, -1.6, 0.5), (0.6, 0.5, -0.4), lens=20.0),
        world_radiance=world,  # type: ignore[arg-type]
    )


def _material(random: np.random.Generator, index: int) -> Material:
    color = tuple((0.2 + 0.6 * random.random(3)).tolist())
    emission = tuple((2.0 * random.random(3)).tolist()) if random.random() < 0.15 else (0.0, 0.0, 0.0)
    if random.random() < 0.6:
        return Material(f"dull {index}", DIFFUSE, color, emission=emission)  # type: ignore[arg-type]
    return Material(
        f"glossy {index}",
        PRINCIPLED,
        color,  # type: ignore[arg-type]
        roughness=float(random.random()),
        metallic=float(random.random() < 0.3),
        emission=emission,  # type: ignore[arg-type]
    )


def _things(random: np.random.Generator) -> Iterator[Mesh]:
    for number in range(int(random.integers(0, 3))):
        low = random.uniform(-1.2, 0.8, 3) * (1.0, 1.0, 0.0) - (0.0, 0.0, 1.0)
        box = inward_box(low, low + random.uniform(0.3, 0.8, 3), [int(random.integers(4))] * 6, outward=True)
        for side in box:
            yield replace(side, name=f"thing {number} {side.name}")
    if random.random() < 0.3:
        yield quad((0.2, -0.5, 0.2), (0.5, 0, 0), (0, 0.5, 0), int(random.integers(4)), name="sheet")


def _lamps(random: np.random.Generator) -> Iterator[Light]:
    for number in range(int(random.integers(0, 4))):
        kind = (POINT, SPOT, SUN, AREA)[int(random.integers(4))]
        power = 0.0 if random.random() < 0.15 else float(random.uniform(1.0, 2.0) * (1.0 if kind == SUN else 20.0))
        x, y, z = random.uniform(-1.0, 1.0, 3) * (1.5, 1.5, 0.5) + (0.0, 0.0, 0.3)
        if random.random() < 0.2:
            z += 5.0
        upside_down = random.random() < 0.2
        frame = {"y_axis": (0.0, -1.0, 0.0), "z_axis": (0.0, 0.0, -1.0)} if upside_down else {}
        radius = 0.1 if kind in (POINT, SPOT) and random.random() < 0.5 else 0.0
        yield Light(f"{kind} {number}", kind, (power,) * 3, (x, y, z), radius=radius, size_x=0.4, size_y=0.3, **frame)


def _with_light(mesh: Mesh, materials: tuple[Material, ...]) -> Mesh:
    """`mesh` with the reflectance and radiant exitance of its material on each triangle."""
    looks = [materials[index] for index in mesh.material_indices]
    reflectance = np.array([look.base_color for look in looks], np.float32) * 0.8
    emission = np.pi * np.array([look.emission for look in looks], np.float32)
    return replace(mesh, reflectance=reflectance, emission=emission)


def _lights(random: np.random.Generator, snapshot: SceneSnapshot) -> VirtualLightMesh:
    times = int(random.integers(0, 3))
    corners = np.concatenate([split(mesh.positions[mesh.triangles], times) for mesh in snapshot.meshes])
    count = 4**times

    def spread(name: str) -> np.ndarray:
        return np.concatenate([np.repeat(getattr(mesh, name), count, axis=0) for mesh in snapshot.meshes])

    lights = lights_from_triangles(corners, spread("emission"), spread("reflectance"), spread("tag_ids"))
    if random.random() < 0.2:
        # Drawn by hand, away from every surface: measured on itself.
        card = np.array([[(-0.5, -0.5, 3.0), (-0.5, 0.5, 3.0), (0.5, -0.5, 3.0)]])
        return lights_from_triangles(card, 0.0, 0.7)
    if random.random() < 0.1:
        return replace(lights, colour=np.zeros_like(lights.colour), emission=np.zeros_like(lights.emission))
    return lights


def _changed(random: np.random.Generator, shot: Shot) -> Shot:
    snapshot, lights = shot.snapshot, shot.light_mesh
    changed = CHANGES[int(random.integers(len(CHANGES)))]
    if changed == "lamp" and snapshot.lights:
        moved = replace(snapshot.lights[0], position=tuple((random.uniform(-1.0, 1.0, 3) * (1, 1, 0.5)).tolist()))
        snapshot = replace(snapshot, lights=(moved, *snapshot.lights[1:]))
    elif changed == "thing":
        last = snapshot.meshes[-1]
        moved_mesh = replace(last, positions=last.positions + random.uniform(-0.2, 0.2, 3), dynamic=True)
        snapshot = replace(snapshot, meshes=(*snapshot.meshes[:-1], moved_mesh))
    elif changed == "camera":
        camera = camera_at((-1.6, -1.7, 0.2), tuple(random.uniform(-0.5, 0.5, 3).tolist()), lens=20.0)
        snapshot = replace(snapshot, camera=camera)
    elif changed == "colour":
        lights = replace(lights, colour=np.ascontiguousarray(lights.colour[:, ::-1]))
    return Shot(snapshot, lights, changed)
