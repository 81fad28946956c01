# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes that follow the rays of specular lobes have in common (passes/reflection_ray.glsl)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...core.settings import OWN, setting
from ..local_space import HALF_DIAGONAL
from ..view import View

DIAGONAL = 2.0 * HALF_DIAGONAL
"""Of every scene's visible bounds, in local units: no ray between two of its surfaces is longer."""


@dataclass(frozen=True)
class RaySettings:
    """Which surfaces send rays, and how far these go."""

    reach: float = setting(
        1.0,
        "share",
        1e-3,
        1.0,
        "Of the scene's diagonal that a ray goes at most; hits fade over the last tenth",
        source="003, 4.3.1: a certain distance",
    )
    thickness: float = setting(
        0.005,
        "share",
        0.0,
        1.0,
        "Of the scene's diagonal that things are deep behind what is seen of them: rays that come in behind fade over "
        "it and pass beyond it; more fills gaps behind thick things and smears thin ones",
        source="003, 6.2.4: a fixed distance",
    )
    fade_start: float = setting(
        0.5, "roughness", 0.0, 1.0, "From which on reflections fade: one ray for each pixel is noisy there", source=OWN
    )
    fade_end: float = setting(0.8, "roughness", 0.0, 1.0, "From which on surfaces have no such reflections", source=OWN)


def ray_uniforms(view: View, settings: RaySettings, sample_index: int) -> dict[str, Any]:
    """What passes/reflection_ray.glsl needs. sample_index: of the picture; every pass of it follows the same rays."""
    return {
        "camera_position": view.position,
        "camera_backward": view.backward,
        "is_orthographic": view.is_orthographic,
        "sample_index": sample_index,
        "roughness_fade": (settings.fade_start, settings.fade_end),
    }
