# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light scaled up in place of indirect light (seed 000, 5.1.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...core.scene_facts import OWN_SPECULAR, TechniqueFacts
from ...core.settings import setting
from ..passes.direct_light import DirectLightPass
from ..picture_shares import picture_shares
from ..technique import FrameInputs, SceneInputs, Technique

if TYPE_CHECKING:
    import moderngl

SHADOWED_SHARE = 0.5
"""Of direct light that is left with shadows (seed 000, eq. 5.2)."""


@dataclass(frozen=True)
class Settings:
    """How bright."""

    multiplier: float = setting(
        1.3,
        "times",
        1.0,
        4.0,
        "Brightness of what no shadow falls on, of its direct light; 0.5 less of it where it is in shadow",
        source="000, eq. 5.2 and table 5.9: best at 1.3",
    )


class ScaledDirect(Technique):
    """Half of the direct light as it is, and the rest and more of it without shadows.

    Known bias: what faces away from every lamp stays black, shadows never get darker than the multiplier less 0.5, and
    no colour bleeds: nothing of this is indirect light. Highlights show in shadows too. What it adds comes through
    walls, from a lamp that is shut in as from any other. The world's light is left out: it would light closed rooms.
    """

    name = "scaled_direct"
    label = "Scaled direct light"
    description = (
        "Shadows half as dark, through walls too, and all else brighter, in place of a bounce: a cheap fallback"
    )
    settings = Settings

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """What it finds by itself."""
        return TechniqueFacts(cls.name, specular=OWN_SPECULAR)

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        shares = {"without_shadow": settings.multiplier - SHADOWED_SHARE, "with_shadow": 1.0 - SHADOWED_SHARE}
        self._pass = DirectLightPass(
            scene.context,
            scene.shaders,
            scene.settings.width,
            scene.settings.height,
            fragment="techniques/scaled_direct.frag",
            outputs=2,
            uniforms=shares,
        )
        lamps = tuple(light for light in scene.snapshot.lights if not light.from_world)
        self._shadows = scene.shadows.for_lights(lamps)
        self._shares = picture_shares(lamps, scene.settings.samples)

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """What is added to the diffuse light: never negative, since shadows take away at most what is added."""
        settings, index = self.scene.settings, frame.sample_index
        with self.scene.timer.measure("scaled direct light"):
            return self._pass.render(
                frame.gbuffer,
                self._shadows,
                frame.view,
                index,
                settings.samples,
                settings.shadow_samples,
                self._shares[index],
            )

    def reasons(self) -> list[str]:
        """Why the world's light is not scaled."""
        if len(self._shadows.lights) == len(self.scene.snapshot.lights):
            return []
        return ["the world's light is not scaled: without shadows it would light closed rooms"]

    def specular(self) -> moderngl.Texture:
        """What is added to the highlights."""
        return self._pass.images[1]
