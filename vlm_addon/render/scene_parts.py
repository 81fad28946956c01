# SPDX-License-Identifier: GPL-3.0-or-later
"""What each of two techniques gets to know of a scene that they share: chosen lights, or all but what is chosen."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace

from ..core.bounce_parts import Choice, Reflected, reflected, without_bounce
from .device import PassTimer
from .technique import SceneInputs


class PartTimer(PassTimer):
    """Measures passes under the name of their part."""

    def __init__(self, timer: PassTimer, part: str) -> None:
        self._timer, self._part = timer, part

    @property
    def kind(self) -> str:
        return self._timer.kind

    def measure(self, name: str) -> AbstractContextManager[None]:  # type: ignore[override]
        return self._timer.measure(f"{self._part}: {name}")

    def timings(self) -> list[tuple[str, float]]:
        return self._timer.timings()


def chosen_inputs(scene: SceneInputs, choice: Choice, name: str) -> SceneInputs:
    """The whole scene, with chosen lights alone. name: of the part, before those of its passes."""
    return replace(_with_lights(scene, choice, is_chosen=True), timer=PartTimer(scene.timer, name))


def rest_inputs(scene: SceneInputs, choice: Choice, name: str) -> SceneInputs:
    """The scene whose chosen surfaces bounce nothing, without their lights. What is kept for it is kept apart, so that
    neither part makes the other's anew with each frame."""
    kept = scene.kept.part(name)
    return replace(
        _with_lights(scene, choice, is_chosen=False),
        timer=PartTimer(scene.timer, name),
        snapshot=without_bounce(scene.snapshot, choice),
        world=without_bounce(scene.world, choice),
        kept=kept,
        structures=scene.structures.kept_in(kept),
    )


def _with_lights(scene: SceneInputs, choice: Choice, is_chosen: bool) -> SceneInputs:
    assert scene.light_mesh is not None
    assert scene.world_lights is not None
    rows = choice.lights(scene.light_mesh) == is_chosen
    local, world = scene.light_mesh.subset(rows), scene.world_lights.subset(rows)
    return replace(scene, light_mesh=local, world_lights=world)


def kept_reflected(scene: SceneInputs, choice: Choice) -> Reflected:
    """`reflected`, found anew where what it depends on has changed."""
    world, lights = scene.world, scene.world_lights
    assert lights is not None
    surfaces = [
        [mesh.name, mesh.dynamic, mesh.positions, mesh.triangles, mesh.tag_ids, mesh.reflectance]
        for mesh in world.meshes
    ]
    key = scene.kept.digests.of(
        choice,
        surfaces,
        lights.vertices,
        lights.triangles,
        lights.colour,
        lights.strength,
        lights.tag_ids,
        lights.dynamic,
    )
    return scene.kept.get("chosen_surfaces", key, lambda: reflected(world, lights, choice))
