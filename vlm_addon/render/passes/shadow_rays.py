# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through the octree to picked source samples, and the share of the light that gets there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.progress import Progress, step
from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS
from ..light_points import GpuLightPoints
from ..local_space import LocalSpace
from ..scene_octree import SceneOctree
from ..shader_library import ShaderLibrary, set_uniforms
from .gbuffer import GBuffer
from .light_picks import LightPicks
from .pick_points import GROUP_SIDE, LIGHT_POINT_BINDING, POINT_DEFINES

if TYPE_CHECKING:
    import moderngl

_OCTREE_BINDING, _TRIANGLE_BINDING, _COUNT_BINDING = 1, 2, 4
_IRRADIANCE_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
_SHADOWED_UNIT, _UNSHADOWED_UNIT = _IRRADIANCE_UNIT + 1, _IRRADIANCE_UNIT + 2


@dataclass(frozen=True)
class ShadowRays:
    """What a picture's rays found, RGBA32F in W/m²: of what the picked lights give, what gets there, and all."""

    shadowed: moderngl.Texture
    unshadowed: moderngl.Texture


class ShadowRayPass:
    """Casts a ray for each pick."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._shaders = shaders
        self._size = (width, height)
        self._rays = ShadowRays(*(context.texture(self._size, 4, dtype="f4") for _ in range(2)))
        self._counts = context.buffer(bytes(8))

    def render(
        self,
        picks: LightPicks,
        gbuffer: GBuffer,
        irradiance: moderngl.Texture,
        radiosity: moderngl.Buffer,
        points: GpuLightPoints,
        octree: SceneOctree,
        space: LocalSpace,
        exact_reach: int,
        progress: Progress,
    ) -> ShadowRays:
        """picks: of PickPointsPass. irradiance: W/m², that they were picked from. space: of the G-buffer and `points`.
        exact_reach: of octree_points_see. `progress` hears of every ray of the pixels. The next call overwrites the
        textures."""
        defines = {
            **POINT_DEFINES,
            "PICK_GROUPS": picks.groups,
            "OCTREE_BINDING": _OCTREE_BINDING,
            "OCTREE_TRIANGLE_BINDING": _TRIANGLE_BINDING,
            "RAY_COUNT_BINDING": _COUNT_BINDING,
            "IRRADIANCE_UNIT": _IRRADIANCE_UNIT,
        }
        shader = self._shaders.compute("passes/shadow_rays.comp", defines)
        gbuffer.bind()
        irradiance.use(_IRRADIANCE_UNIT)
        octree.bind(_OCTREE_BINDING, _TRIANGLE_BINDING)
        radiosity.bind_to_storage_buffer(int(CONSTANTS["RADIOSITY_BINDING"]))
        points.points.bind_to_storage_buffer(LIGHT_POINT_BINDING)
        self._counts.bind_to_storage_buffer(_COUNT_BINDING)
        picks.bind_read(shader)
        self._rays.shadowed.bind_to_image(0)
        self._rays.unshadowed.bind_to_image(1)
        set_uniforms(shader, {"frame": octree.uniform(space), "exact_reach": exact_reach})
        groups = tuple(-(-side // GROUP_SIDE) for side in self._size)
        for index in range(picks.count):
            set_uniforms(shader, {"index": index})
            shader.run(*groups)
            self._context.memory_barrier()
            step(progress, (index + 1) / picks.count, "visibility")
        return self._rays

    def counters(self) -> dict[str, float]:
        """Rays cast in this frame, and those of them that something is in the way of."""
        cast, blocked = np.frombuffer(self._counts.read(), np.uint32).tolist()
        return {"visibility_rays": cast, "visibility_rays_blocked": blocked}


class ShadowRatioPass:
    """Irradiance times the share that gets there."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        units = {
            "IRRADIANCE_UNIT": _IRRADIANCE_UNIT,
            "SHADOWED_UNIT": _SHADOWED_UNIT,
            "UNSHADOWED_UNIT": _UNSHADOWED_UNIT,
        }
        self._pass = FullscreenPass(context, shaders, "passes/shadow_ratio.frag", units)
        self._irradiance, self.ratio = (context.texture((width, height), 4, dtype="f4") for _ in range(2))
        self._target = context.framebuffer([self._irradiance, self.ratio])

    def render(self, irradiance: moderngl.Texture, rays: ShadowRays) -> moderngl.Texture:
        """What of `irradiance` gets there, RGBA32F; leaves the share, rgb, in `ratio`. rays: maybe filtered. The next
        call overwrites both."""
        irradiance.use(_IRRADIANCE_UNIT)
        rays.shadowed.use(_SHADOWED_UNIT)
        rays.unshadowed.use(_UNSHADOWED_UNIT)
        self._pass.draw(self._target)
        return self._irradiance
