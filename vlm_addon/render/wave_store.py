# SPDX-License-Identifier: GPL-3.0-or-later
"""Waves and their shadow maps, kept over frames: a wave until its lamp or the bounds of the scene change, its maps
until something that casts shadows does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ..core.array_codec import content_hash
from ..core.light_wave import Wave, WaveSettings, lamp_waves
from ..core.scene import NO_TEXTURE, Float64, Light, SceneSnapshot
from .passes.wave_shadow import WaveMaps

T = TypeVar("T")


class WaveStore:
    """What the frames of a device share. computed, drawn: lamps' waves computed and maps drawn since `begin`."""

    def __init__(self) -> None:
        self._kept: dict[str, Any] = {}
        self._used: dict[str, Any] = {}
        self.computed = 0
        self.drawn = 0

    def begin(self) -> None:
        """Starts a frame."""
        self._used = {}
        self.computed = self.drawn = 0

    def end(self) -> None:
        """Lets go of what was not asked for since `begin`."""
        self._kept = self._used

    def waves(self, light: Light, low: Float64, high: Float64, settings: WaveSettings) -> tuple[Wave, ...]:
        """Those of core.light_wave.lamp_waves."""

        def make() -> tuple[Wave, ...]:
            self.computed += 1
            return lamp_waves(light, low, high, settings)

        return self._get(content_hash(["waves", light, low, high, settings]), make)

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

        return self._get(content_hash(["maps", *places, occluders, size]), make)

    def _get(self, key: str, make: Callable[[], T]) -> T:
        if key not in self._used:
            self._used[key] = self._kept.pop(key) if key in self._kept else make()
        found: T = self._used[key]
        return found


def occluders_key(snapshot: SceneSnapshot) -> str:
    """A hash of all that shadow maps of the scene depend on but the lights."""
    meshes = [[mesh.positions, mesh.triangles, mesh.material_indices, mesh.corner_uvs] for mesh in snapshot.meshes]
    used = {material.alpha_texture for material in snapshot.materials} - {NO_TEXTURE}
    alphas = [(material.alpha, material.alpha_texture, material.alpha_channel) for material in snapshot.materials]
    textures = [snapshot.textures[index] for index in sorted(used)]
    return content_hash([meshes, alphas, textures])
