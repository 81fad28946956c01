# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a frame and of each of its pictures, from the facts of the scene and what the device counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.effects import EffectPlan, parse_choices, plan_effects
from ..core.light_mesh import VirtualLightMesh
from ..core.occluders import Occlusion, find_occlusion, occluding_triangles
from ..core.reach import BOUNDED_KINDS, Bools
from ..core.scene import Float64, Light, SceneSnapshot
from ..core.scene_facts import ScreenFacts, TechniqueFacts, gather_facts, lamp_facts, lamp_sources, lights_picture
from .frame_types import RenderSettings
from .kept import Kept


class FramePlanner:
    """Facts of one frame; `plan` is that of all of it so far. occluders: triangles of each mesh that may stand before
    a surface as its lights see it; None for all."""

    def __init__(
        self,
        kept: Kept,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh | None,
        world_lights: Sequence[Light],
        technique: TechniqueFacts,
        settings: RenderSettings,
    ) -> None:
        """snapshot: in world space. world_lights: all suns that stand for its world. Raises InvalidInput for an unknown
        effect."""
        self._choices, _ = parse_choices(settings.effects)
        self._economical = settings.economical
        self._snapshot = snapshot
        self._light_mesh = light_mesh
        occlusion, found = _occlusions(kept, snapshot, light_mesh, world_lights)
        self.occluders = found.triangles
        self._facts = gather_facts(snapshot, light_mesh, technique, occlusion, found.occlusion, settings.samples)
        self.plan = plan_effects(self._facts, self._choices, economical=self._economical)
        self._pictures = 0

    @property
    def asks_screen(self) -> bool:
        """Whether what a picture shows may change what it needs."""
        bounded = any(lamp.kind in BOUNDED_KINDS for lamp in self._snapshot.lights)
        return self._economical and self._facts.has_light and bool(self._facts.glossy or bounded)

    @property
    def has_glossy(self) -> bool:
        """Whether any surface of the scene has a specular layer."""
        return bool(self._facts.glossy)

    def picture(self, screen: ScreenFacts | None) -> EffectPlan:
        """The plan of the next picture. screen: what it shows, None where nobody has counted."""
        if screen is None:
            return self.plan
        lamps = lamp_facts(self._snapshot, self._light_mesh, screen)
        facts = replace(self._facts, screen=screen, lamps=lamps)
        plan = plan_effects(facts, self._choices, economical=self._economical)
        self.plan = plan if self._pictures == 0 else self.plan.merged(plan)
        self._pictures += 1
        return plan

    def lamp_shares(self, screen: ScreenFacts | None, lights: Sequence[Light], shares: Float64) -> Float64:
        """`shares`, (n,) weights of `lights` in a picture, 0 for those that light nothing of it."""
        if screen is None:
            return shares
        reach = [max(light.power) > 0.0 and lights_picture(light, screen) for light in lights]
        return np.where(reach, shares, 0.0)


@dataclass(frozen=True)
class _Occluders:
    """Of light from lamps and world. triangles: as core.occluders.occluding_triangles."""

    occlusion: Occlusion
    triangles: tuple[Bools, ...] | None


def _occlusions(
    kept: Kept, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None, world_lights: Sequence[Light]
) -> tuple[Occlusion, _Occluders]:
    """Of light between surfaces, and of that from lamps and world, too."""
    meshes = snapshot.meshes
    points = np.zeros((0, 3)) if light_mesh is None else light_mesh.samples.positions
    key = kept.digests.of([[mesh.positions, mesh.triangles] for mesh in meshes], points)
    between = kept.get("occlusion", key, lambda: find_occlusion(meshes, points))
    sources, directions = lamp_sources((*snapshot.lights, *world_lights))
    starts = np.concatenate([points, sources])

    def find() -> _Occluders:
        occlusion = between if between.possible else find_occlusion(meshes, starts, directions)
        return _Occluders(occlusion, occluding_triangles(meshes, occlusion, starts, directions))

    return between, kept.get("occluders", kept.digests.of(key, sources, directions), find)
