# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows of the waves of a frame: which lights have maps, how large those are, and what each pixel sees by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..core.light_wave import SPREAD_LIGHTS, Wave, sampled_frames, sampled_lights, spread_frames, spread_lights
from ..core.scene import Float64
from ..core.stacked_hemispheres import integrated_shadow_count, shadow_map_bytes
from .geometry import GpuGeometry
from .local_space import LocalSpace, make_local_space
from .passes.gbuffer import GBuffer
from .passes.wave_shadow import WaveMapPass, WaveMaps, WaveShadowPass
from .technique import SceneInputs
from .wave_store import WaveStore, occluders_key

if TYPE_CHECKING:
    import moderngl

ACCURATE, INTEGRATED, NONE = "accurate", "integrated", "none"
MOST_MAP_BYTES = 1 << 30
"""Of all maps together; beyond, they get smaller."""


@dataclass(frozen=True)
class WaveShadowSettings:
    """kind: ACCURATE, INTEGRATED or NONE. maps: of each wave, where accurate. steps: between two maps, where
    integrated. scale: width and height of a map, times the picture's."""

    kind: str
    maps: int
    steps: int
    scale: float


class _StillScene:
    """The scene in a space that does not follow the camera, uploaded when a map is to be drawn: maps that are kept
    while the camera moves are then the same as those that another frame would draw."""

    def __init__(self, scene: SceneInputs, draw_pass: WaveMapPass) -> None:
        self._scene = scene
        self._pass = draw_pass

    def draw(self, positions: Float64, frames: Float64) -> WaveMaps:
        """Maps as by WaveMapPass."""
        geometry, space = self._uploaded
        return self._pass.draw(geometry, space, positions, frames)

    @cached_property
    def _uploaded(self) -> tuple[GpuGeometry, LocalSpace]:
        world = replace(self._scene.world, camera=None)
        space = make_local_space(world)
        return GpuGeometry(self._scene.context, space.scene(world), np.zeros(3)), space


class WaveShadows:
    """The maps of all waves, drawn where the store has none. map_count, shadow_count: of all waves together. scale: as
    in WaveShadowSettings, smaller where the device or MOST_MAP_BYTES hold no more."""

    def __init__(
        self, scene: SceneInputs, store: WaveStore, waves: Sequence[Wave], settings: WaveShadowSettings
    ) -> None:
        self._scene = scene
        self._settings = settings
        width, height = scene.settings.width, scene.settings.height
        lights = [self._lights(wave) for wave in waves]
        self.map_count = sum(len(positions) for positions, _ in lights)
        self.shadow_count = self.map_count
        if settings.kind == INTEGRATED:
            self.shadow_count = integrated_shadow_count(SPREAD_LIGHTS, settings.steps) * len(waves)
        largest = int(scene.context.info["GL_MAX_TEXTURE_SIZE"]) / max(width, height)
        needed = shadow_map_bytes(width, height, 1.0, max(self.map_count, 1))
        self.scale = float(min(settings.scale, largest, (MOST_MAP_BYTES / needed) ** 0.5))
        self._pass = WaveShadowPass(scene.context, scene.shaders, width, height)
        size = (max(1, round(self.scale * width)), max(1, round(self.scale * height)))
        self._map_pass = WaveMapPass(scene.context, scene.shaders, size)
        self._maps: list[WaveMaps] = []
        if self.map_count:
            occluders = occluders_key(scene.world, scene.kept.digests)
            with scene.timer.measure("indirect shadow maps"):
                still = _StillScene(scene, self._map_pass)
                self._maps = [store.maps(still.draw, places, occluders, size) for places in lights]

    def visibility(self, gbuffer: GBuffer, index: int) -> moderngl.Texture | None:
        """Share of a wave that each pixel sees, R32F; None where nothing is shadowed. The next call overwrites it."""
        if not self._maps:
            return None
        maps, space = self._maps[index], self._scene.space
        records = [self._map_pass.record(space, *place) for place in zip(maps.positions, maps.frames, strict=True)]
        with self._scene.timer.measure("indirect shadows"):
            if self._settings.kind == ACCURATE:
                return self._pass.accurate(gbuffer, maps, records)
            return self._pass.integrated(gbuffer, maps, records, self._settings.steps)

    def nbytes(self) -> int:
        """Of all maps."""
        settings = self._scene.settings
        return shadow_map_bytes(settings.width, settings.height, self.scale, self.map_count)

    def reasons(self) -> list[str]:
        """Why maps are smaller than asked for."""
        if self.scale >= self._settings.scale or not self._maps:
            return []
        limit = f"the device's limits or {MOST_MAP_BYTES >> 20} MiB for {self.map_count} maps"
        return [f"indirect shadow maps are {self.scale:.2f} times the picture's size, to keep {limit}"]

    def _lights(self, wave: Wave) -> tuple[Float64, Float64]:
        """Positions and frames of the maps of a wave."""
        if self._settings.kind == NONE:
            return wave.positions[:0], wave.positions[:0]
        if self._settings.kind == ACCURATE:
            lights = sampled_lights(wave, self._settings.maps)
            return wave.positions[lights], sampled_frames(wave, lights)
        lights = spread_lights(wave)
        return wave.positions[lights], spread_frames(wave, lights)
