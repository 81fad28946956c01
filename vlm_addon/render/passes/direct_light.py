# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that comes straight from the lamps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.scene import Float64
from ..albedo_texture import AlbedoTexture
from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS, LAMP
from ..lamp_shadows import LampShadows
from ..shader_library import ShaderLibrary, set_uniforms
from ..shadow_windows import ALL_DISTANCES, FADE, ViewWindow, view_windows
from ..view import View
from .distance_range import DistanceRange
from .gbuffer import GBuffer
from .shadow_map import ShadowMap

if TYPE_CHECKING:
    import moderngl

FRAGMENT = "passes/direct_light.frag"


class DirectLightPass:
    """Diffuse and specular reflection of every lamp, one draw for each, with filtered shadows.

    Each call takes some points of every soft lamp; the mean over all sample indices converges to the soft shadow.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        width: int,
        height: int,
        fragment: str = FRAGMENT,
        outputs: int = 1,
        uniforms: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """fragment: another shader that is run for each lamp likewise, with what `outputs` images it adds to and
        `uniforms` of its own."""
        self.images = [context.texture((width, height), 4, dtype="f4") for _ in range(outputs)]
        self._framebuffer = context.framebuffer(self.images)
        self._fragment = fragment
        self._uniforms = uniforms
        self._context = context
        self._shaders = shaders
        self._variants: dict[tuple[int, int, bool, bool], FullscreenPass] = {}
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)
        self._albedo = AlbedoTexture(context)
        self._distances = DistanceRange(context, shaders)

    def render(
        self,
        gbuffer: GBuffer,
        shadows: LampShadows,
        view: View,
        sample_index: int,
        sample_count: int,
        shadow_samples: int,
        light_shares: Float64 | None = None,
        *,
        has_highlights: bool = True,
    ) -> moderngl.Texture:
        """Radiance in W/(m² sr) that each pixel sends to the eye, RGBA32F with w 0; 0 where no surface shows.

        Over all samples a soft lamp gets at least `shadow_samples` points: few show as steps in its penumbra.
        light_shares: (n,) weight of each light in this picture, 1 by default. has_highlights: whether lamps show in
        glossy surfaces. The next call overwrites the texture.
        """
        self._framebuffer.clear()
        self._albedo.bind()
        camera = view.camera_uniforms()
        uses_windows = [shadows.uses_windows(lamp) for lamp in range(len(shadows.lights))]
        windows: tuple[ViewWindow, ...] = (ALL_DISTANCES,)
        if any(uses_windows):
            windows = view_windows(view, *shadows.bounds, *self._distances.measure(gbuffer, view))
        shares = np.ones(len(shadows.lights)) if light_shares is None else light_shares
        for lamp in np.flatnonzero(shares).tolist():
            # A picture of few samples still gets enough points of each soft lamp.
            together = shadows.samples_of(lamp, -(-shadow_samples // sample_count))
            for part in range(together):
                index = sample_index * together + part
                for part_of_view in windows if uses_windows[lamp] else (ALL_DISTANCES,):
                    shadow_map = shadows.shadow_map(lamp, index, sample_count * together, together, part_of_view.window)
                    outer = part_of_view.outer if part_of_view.outer < math.inf else 0.0
                    uniforms = {"weight": shares[lamp] / together, "distances": (outer, part_of_view.inner)}
                    self._add(gbuffer, shadow_map, camera | uniforms | dict(self._uniforms), has_highlights)
        return self.images[0]

    def _add(self, gbuffer: GBuffer, shadow_map: ShadowMap, uniforms: dict[str, Any], has_highlights: bool) -> None:
        # New storage: llvmpipe (Mesa 22) lets a write overtake draws that still read the old one.
        self._lamp.orphan()
        self._lamp.write(shadow_map.record.tobytes())
        self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
        # Drawing a shadow map binds the materials' textures to the units of the G-buffer.
        gbuffer.bind()
        shadow_map.bind()
        fullscreen = self._variant(shadow_map.record[0], has_highlights)
        set_uniforms(fullscreen.program, uniforms)
        fullscreen.draw(self._framebuffer, additive=True)

    def _variant(self, lamp: np.void, has_highlights: bool) -> FullscreenPass:
        """The pass compiled for lamps of this kind."""
        key = (int(lamp["kind"]), int(lamp["shadow_kind"]), bool(lamp["radius"] > 0.0), has_highlights)
        if key not in self._variants:
            defines: dict[str, int | float | bool] = dict(
                zip(("LAMP_KIND", "SHADOW_KIND", "HAS_RADIUS", "HAS_HIGHLIGHTS"), key, strict=True)
            )
            defines["WINDOW_FADE"] = FADE
            self._variants[key] = FullscreenPass(self._context, self._shaders, self._fragment, defines)
        return self._variants[key]
