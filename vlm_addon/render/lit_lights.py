# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual lights of a scene and what they send out (phase one, seed 002, 3.2), kept over frames lamp by lamp.

All of it is found in a space that no camera moves. What falls on the lights from a lamp is kept for a power of 1, so
that a lamp which is dimmed or switched costs nothing, and one that moves costs what it alone costs.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.scene import Float32, Float64
from .passes.phase_one import PhaseOnePass
from .technique import SceneInputs
from .virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl

    from .lamp_shadows import LampShadows

PHASE_ONE, RADIOSITY, VIRTUAL_LIGHTS = "phase one", "radiosity", "virtual lights"


def scene_lights(scene: SceneInputs) -> GpuVirtualLights:
    """The lights of the scene's light mesh in the frame's space. Raises DeviceError where they do not fit."""
    assert scene.light_mesh is not None
    assert scene.world_lights is not None
    mesh = scene.world_lights
    key = scene.kept.digests.of(mesh.vertices, mesh.triangles, mesh.tag_ids, mesh.links, mesh.strength, scene.space)
    make = partial(GpuVirtualLights, scene.context, scene.light_mesh, scene.geometry.origin)
    return scene.kept.several(VIRTUAL_LIGHTS, key, make)


def scene_radiosity(scene: SceneInputs) -> moderngl.Buffer:
    """One vec4 for each light: rgb = radiosity in W/m², w 0. Raises as PhaseOnePass.render."""
    assert scene.world_lights is not None
    mesh, kept = scene.world_lights, scene.kept
    shadows, space = scene.shadows.still()
    still_mesh = space.light_mesh(mesh)
    phase_one = PhaseOnePass(scene.context, scene.shaders)
    measured = kept.digests.of(mesh.samples, mesh.vertices, mesh.triangles, space, scene.settings.shadow_samples)
    lamps = [row for row, light in enumerate(scene.snapshot.lights) if max(light.power) > 0.0]
    world = [row for row in lamps if shadows.lights[row].from_world]
    groups = [[row] for row in lamps if row not in set(world)] + ([world] if world else [])
    irradiance, keys = np.zeros((len(mesh), 3)), []
    for done, rows in enumerate(groups):
        key = _group_key(scene, shadows, rows, measured)

        def fall(rows: list[int] = rows, done: int = done) -> Float32:
            progress = _within(scene.progress, done / len(groups), 1.0 / len(groups))
            return phase_one.render(still_mesh, np.zeros(3), shadows, rows, scene.settings.shadow_samples, progress)

        powers = [1.0] if rows == world else scene.world.lights[rows[0]].power
        irradiance += np.array(powers) * kept.several(PHASE_ONE, key, fall)
        keys.append((key, powers))
    values = radiosity_of(mesh, irradiance)
    key = kept.digests.of(keys, mesh.colour, mesh.emission, mesh.strength)
    return kept.several(RADIOSITY, key, lambda: _upload(scene.context, values))


def _group_key(scene: SceneInputs, shadows: LampShadows, rows: list[int], measured: str) -> str:
    """Of what falls on the lights from some lamps."""
    lamps = [replace(scene.world.lights[row], name="", power=shadows.lights[row].power) for row in rows]
    return scene.kept.digests.of(measured, lamps, [shadows.key(row) for row in rows])


def _upload(context: moderngl.Context, radiosity: Float32) -> moderngl.Buffer:
    padded = np.zeros((max(len(radiosity), 1), 4), np.float32)
    padded[: len(radiosity), :3] = radiosity
    return context.buffer(padded.tobytes())


def radiosity_of(light_mesh: VirtualLightMesh, irradiance: Float64 | Float32) -> Float32:
    """(n, 3) W/m² that the lights send out where `irradiance`, (n, 3) W/m², falls on them."""
    reflected = light_mesh.colour * irradiance.astype(np.float64)
    return np.asarray(light_mesh.strength[:, None] * (light_mesh.emission + reflected), np.float32)


def _within(progress: Progress, start: float, share: float) -> Progress:
    return lambda fraction, label: progress(start + fraction * share, label)
