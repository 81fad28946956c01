# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes into a frame and what comes out of it, as plain data that can cross a process border."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..core.effects import EffectPlan
from ..core.errors import InvalidInput
from ..core.scene import Finding, Float32


@dataclass(frozen=True)
class RenderSettings:
    """Size, technique and quality of one frame.

    technique_settings: values by name, checked against the technique's own settings dataclass. samples: jittered
    pictures averaged per pixel (box filter of one pixel). shadow_samples: points of a
    soft lamp, in phase one and at least in the finished picture. buffers: also return every intermediate image.
    world_lights: directions that stand for what the world sends, each with a shadow map; none where it is black.
    Direct light, whose shadows are seen, has up to four times as many with more samples. display: also return the
    picture as the local tone mapping operator shows it. effects: "auto", "on" or "off" by name of effect
    (core/effect_rules.py), and their settings by "EFFECT.SETTING". economical: leave out effects that would change
    nothing and use again what earlier frames made; otherwise all that is enabled runs anew. plan_only: give the plan of
    the picture's middle sample, and no picture.
    """

    width: int
    height: int
    technique: str = "vlm"
    technique_settings: Mapping[str, Any] = field(default_factory=dict)
    samples: int = 16
    shadow_resolution: int = 1024
    shadow_samples: int = 32
    buffers: bool = False
    world_lights: int = 64
    display: bool = False
    effects: Mapping[str, Any] = field(default_factory=dict)
    economical: bool = True
    plan_only: bool = False


LIMITS = {
    "width": 16384,
    "height": 16384,
    "samples": 4096,
    "shadow_resolution": 8192,
    "shadow_samples": 1024,
    "world_lights": 1024,
}
"""The largest value of each number in RenderSettings; the smallest is 1."""


def require_in_range(settings: RenderSettings) -> None:
    """Raises InvalidInput for a number that is out of range."""
    for name, limit in LIMITS.items():
        value = getattr(settings, name)
        if not 1 <= value <= limit:
            raise InvalidInput(f"render setting {name!r}", f"{value} is out of range", f"give 1 to {limit}")


@dataclass(frozen=True)
class Frame:
    """A finished picture.

    images: float32 (h, w, c) linear Rec.709, row 0 at the top; always `combined` (RGBA, premultiplied), `direct` and
    `indirect` (RGB radiance, W/(m² sr)); on demand `display` (RGBA, display-linear in [0, 1]). timings: (pass name,
    milliseconds) in order. counters: what was counted (lights, triangles, samples …). device: name of the device;
    timer: how milliseconds were taken. reasons: why a pass ran in another way than was asked for. plan: which effects
    ran, what of earlier frames was used again, and why.
    """

    images: dict[str, Float32]
    timings: list[tuple[str, float]]
    counters: dict[str, float]
    device: str
    timer: str
    findings: tuple[Finding, ...] = ()
    reasons: tuple[str, ...] = ()
    plan: EffectPlan = field(default_factory=EffectPlan)
