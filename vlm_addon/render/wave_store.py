# SPDX-License-Identifier: GPL-3.0-or-later
"""Waves and their shadow maps, kept over frames: a wave until its lamp or the bounds of the scene change, its maps
until something that casts shadows does."""

from __future__ import annotations

from collections.abc import Callable

from ..core.light_wave import Wave, WaveSettings, lamp_waves
from ..core.scene import NO_TEXTURE, Float64, Light, SceneSnapshot
from .digests import Digests
from .kept import Kept
from .passes.wave_shadow import WaveMaps

WAVES, WAVE_MAPS = "waves", "wave shadow maps"


class WaveStore:
    """What a frame shares with those before it. computed, drawn: lamps' waves computed and maps drawn in it."""

    def __init__(self, kept: Kept) -> None:
        self._kept = kept
        self.computed = 0
        self.drawn = 0

    def waves(self, light: Light, low: Float64, high: Float64, settings: WaveSettings) -> tuple[Wave, ...]:
        """Those of core.light_wave.lamp_waves."""

        def make() -> tuple[Wave, ...]:
            self.computed += 1
            return lamp_waves(light, low, high, settings)

        return self._kept.several(WAVES, self._kept.digests.of(light, low, high, settings), make)

    def maps(
        self,
        draw: Callable[[Float64, Float64], WaveMaps],
        places: tuple[Float64, Float64],
        occluders: str,
        size: tuple[int, ...],
    ) -> WaveMaps:
        """Maps of the lights at `places` (positions and frames in world space), drawn by `draw` of both. occluders: of
        occluders_key."""

        def make() -> WaveMaps:
            self.drawn += len(places[0])
            return draw(*places)

        return self._kept.several(WAVE_MAPS, self._kept.digests.of(*places, occluders, size), make)


def occluders_key(snapshot: SceneSnapshot, digests: Digests) -> str:
    """A hash of all that shadow maps of the scene depend on but the lights."""
    meshes = [[mesh.positions, mesh.triangles, mesh.material_indices, mesh.corner_uvs] for mesh in snapshot.meshes]
    used = {material.alpha_texture for material in snapshot.materials} - {NO_TEXTURE}
    alphas = [(material.alpha, material.alpha_texture, material.alpha_channel) for material in snapshot.materials]
    textures = [snapshot.textures[index] for index in sorted(used)]
    return digests.of(meshes, alphas, textures)
