# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture without indirect light: what every other technique adds to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...core.scene_facts import NO_SPECULAR, TechniqueFacts
from ..technique import FrameInputs, Technique

if TYPE_CHECKING:
    import moderngl


class Direct(Technique):
    """Lamps and emission only. Known bias: all bounced light is missing."""

    name = "direct"
    label = "Direct light only"
    description = "Lamps and glowing surfaces without any bounce; all indirect light is missing"

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """That there is nothing but direct light."""
        return TechniqueFacts(cls.name, has_indirect=False, specular=NO_SPECULAR)

    def indirect(self, frame: FrameInputs) -> moderngl.Texture | None:
        """None: there is no indirect light."""
        return None
