# SPDX-License-Identifier: GPL-3.0-or-later
"""LightWave: indirect light faked by direct light of lights that stand around each lamp (seed 000)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.light_wave import (
    SPREAD_LIGHTS,
    Wave,
    WaveSettings,
    sampled_frames,
    sampled_lights,
    spread_frames,
    spread_lights,
)
from ...core.scene import DIFFUSE, Float32
from ...core.settings import setting
from ...core.stacked_hemispheres import integrated_shadow_count, shadow_map_bytes
from ..local_space import LocalSpace
from ..passes.accumulate import read_image
from ..passes.phase_two import IrradianceImage
from ..passes.wave_light import (
    FACE_BINDING,
    GROUP_SIDE,
    POINT_BINDING,
    RESULT_BINDING,
    WAVE_DEFINES,
    WaveLightPass,
    upload_wave,
)
from ..passes.wave_shadow import WaveMapPass, WaveMaps, WaveShadowPass
from ..point_picture import drawn_points
from ..shader_library import set_uniforms
from ..technique import FrameInputs, SceneInputs, Technique
from ..view import View, make_view
from ..wave_corners import GpuCorners, corners_key, find_corners
from ..wave_store import WaveStore, occluders_key

if TYPE_CHECKING:
    import moderngl

CORNERS, PIXELS = "corners", "pixels"
ACCURATE, INTEGRATED, NONE = "accurate", "integrated", "none"
MOST_MAP_BYTES = 1 << 30
"""Of all shadow maps together; beyond, they get smaller."""
VISIBILITY_UNIT = 10
WITH_ACCURATE, WITH_INTEGRATED = ("shadows", ACCURATE), ("shadows", INTEGRATED)


@dataclass(frozen=True)
class Settings:
    """How many lights, where their light is computed and how it is shadowed."""

    angle: float = setting(
        5.0, "degrees", 2.0, 90.0, "Between neighbouring rays of lights around a lamp", source="000, 3.3"
    )
    shells: int = setting(
        5,
        "count",
        1,
        8,
        "Hemispheres of lights around a lamp; from the sixth on they are dark",
        source="000, 3.3, eq. 4.2",
    )
    reach: float = setting(
        1.0,
        "share",
        0.05,
        4.0,
        "Farthest distance of a light, of the mean distance from the lamp to the end of the scene",
        source="000, eq. 4.1: by the dimensions of the scene",
    )
    active: float = setting(
        1.0, "share", 0.001, 1.0, "Of the lights, switched on by chance; less is faster and noisier", source="000, 3.3"
    )
    computed_at: str = setting(
        CORNERS,
        "",
        None,
        None,
        "Light is computed at corners of triangles and spread over them (as published), or at each pixel (slow)",
        source="000, 4.2",
        choices=(CORNERS, PIXELS),
    )
    strength: float = setting(
        1.0,
        "times",
        0.0,
        100.0,
        "Brightness of the indirect light; at 1 a lamp's light is that at the mean distance to the end of the scene",
    )
    specular: bool = setting(True, "", None, None, "Lights also show in glossy surfaces", source="000, eq. 4.5")
    shadows: str = setting(
        ACCURATE,
        "",
        None,
        None,
        "Of indirect light: maps of lights picked by chance, five maps and steps between them, or none",
        source="000, 4.3",
        choices=(ACCURATE, INTEGRATED, NONE),
    )
    maps: int = setting(
        20, "count", 1, 64, "Lights of each lamp that have a shadow map", source="000, 3.3", only_with=WITH_ACCURATE
    )
    steps: int = setting(
        4,
        "count",
        0,
        32,
        "Between two of the five shadow maps",
        source="000, 4.3: 2, 4, 6, 10",
        only_with=WITH_INTEGRATED,
    )
    map_scale: float = setting(
        3.0, "times", 0.1, 8.0, "A shadow map's width and height, times the picture's", source="000, 4.1"
    )


class LightWave(Technique):
    """Direct light of virtual point lights on hemispheres around each lamp, times the share of shadow maps that see.

    Known bias: nothing bounces, so walls lend no colour and dark rooms are as bright as white ones. A light's distance
    plays no role. All lamps' light is as strong as at the mean distance from the lamp to the end of the scene, so the
    energy is not right anywhere. Around a lamp, nearer than 0.43 of the farthest light, it is dark, since lights
    look away from it. Lights behind walls shine through them, but for the shadow, which darkens all light of a lamp
    alike; what no map sees counts as lit. Computed at corners, light changes evenly over each triangle, however large.
    Glowing surfaces and the world send no waves.
    """

    name = "lightwave"
    label = "LightWave"
    description = "Bounced light faked by lights on hemispheres around each lamp; no colour bleeds, nothing is physical"
    settings = Settings

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        context, shaders, size = scene.context, scene.shaders, (scene.settings.width, scene.settings.height)
        self._store = scene.kept.get("lightwave", "", WaveStore)
        self._store.begin()
        glossy = any(material.model != DIFFUSE for material in scene.snapshot.materials) or not scene.snapshot.materials
        self._has_specular = settings.specular and glossy
        self._waves = self._found_waves()
        self._sum = WaveLightPass(context, shaders, self._has_specular)
        self._gpu_waves = [upload_wave(context, wave, scene.space, settings.strength) for wave in self._waves]
        self._map_scale = self._allowed_scale()
        self._maps = self._found_maps()
        self._store.end()
        self._shadow = WaveShadowPass(context, shaders, *size)
        self._images = {name: IrradianceImage(context, *size) for name in ("light", "specular", "unshadowed")}
        self._wave_images = [IrradianceImage(context, *size) for _ in range(2)]
        defines = {**WAVE_DEFINES, "VISIBILITY_UNIT": VISIBILITY_UNIT, "AT_CORNERS": settings.computed_at == CORNERS}
        self._combine = shaders.compute("techniques/lightwave.comp", defines)
        self._corner_sums: list[moderngl.Buffer] = []
        if settings.computed_at == CORNERS:
            self._sum_at_corners()

    def _found_waves(self) -> list[Wave]:
        chosen = self.chosen
        shape = WaveSettings(chosen.angle, chosen.shells, chosen.reach, chosen.active)
        world = self.scene.world
        if not world.triangle_count:
            return []
        low, high = world.bounds()
        lamps = [light for light in world.lights if not light.from_world]
        return [wave for light in lamps for wave in self._store.waves(light, low, high, shape)]

    def _allowed_scale(self) -> float:
        """The map scale that memory and the device allow."""
        settings, chosen = self.scene.settings, self.chosen
        largest = int(self.scene.context.info["GL_MAX_TEXTURE_SIZE"]) / max(settings.width, settings.height)
        needed = shadow_map_bytes(settings.width, settings.height, 1.0, max(self._map_count(), 1))
        return float(min(chosen.map_scale, largest, (MOST_MAP_BYTES / needed) ** 0.5))

    def _map_count(self) -> int:
        """Of all waves."""
        per_wave = {ACCURATE: self.chosen.maps, INTEGRATED: SPREAD_LIGHTS, NONE: 0}[self.chosen.shadows]
        return per_wave * len(self._waves)

    def _found_maps(self) -> list[WaveMaps]:
        scene, chosen = self.scene, self.chosen
        if chosen.shadows == NONE or not self._waves:
            return []
        size = tuple(max(1, round(self._map_scale * side)) for side in (scene.settings.width, scene.settings.height))
        self._map_pass = WaveMapPass(scene.context, scene.shaders, (size[0], size[1]))
        occluders = occluders_key(scene.world)
        maps = []
        with scene.timer.measure("indirect shadow maps"):
            for wave in self._waves:
                if chosen.shadows == ACCURATE:
                    lights = sampled_lights(wave, chosen.maps)
                    places = wave.positions[lights], sampled_frames(wave, lights)
                else:
                    lights = spread_lights(wave)
                    places = wave.positions[lights], spread_frames(wave, lights)
                maps.append(self._store.maps(self._map_pass, scene.geometry, scene.space, places, occluders, size))
        return maps

    def _sum_at_corners(self) -> None:
        scene = self.scene
        meshes = scene.snapshot.meshes
        corners = scene.kept.get("lightwave_corners", corners_key(meshes), lambda: find_corners(meshes))
        self._corners = GpuCorners(scene.context, corners, meshes, scene.geometry.origin)
        view = self._centred_view()
        with scene.timer.measure("wave of light"):
            self._corner_sums = [
                self._sum.at_corners(scene.geometry, self._corners, wave, view, scene.progress)
                for wave in self._gpu_waves
            ]

    def _centred_view(self) -> View:
        camera, settings = self.scene.snapshot.camera, self.scene.settings
        assert camera is not None
        return make_view(camera, settings.width, settings.height, self.scene.geometry.origin)

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the waves of their light times the share that their maps see (eq. 4.9)."""
        for image in self._images.values():
            image.clear()
        records = self._records()
        for index, wave in enumerate(self._gpu_waves):
            if self.chosen.computed_at == PIXELS:
                with self.scene.timer.measure("wave of light"):
                    light, specular = self._wave_images
                    self._sum.at_pixels(frame.gbuffer, wave, frame.view, light, specular, frame.progress)
            visibility = None
            if self._maps:
                with self.scene.timer.measure("indirect shadows"):
                    visibility = self._visibility(frame, self._maps[index], records[index])
            with self.scene.timer.measure("combine"):
                self._add(frame, index, visibility)
        return self._images["light"].texture

    def _records(self) -> list[list[np.ndarray]]:
        space: LocalSpace = self.scene.space
        return [
            [self._map_pass.record(space, *place) for place in zip(maps.positions, maps.frames, strict=True)]
            for maps in self._maps
        ]

    def _visibility(self, frame: FrameInputs, maps: WaveMaps, records: list[np.ndarray]) -> moderngl.Texture:
        if self.chosen.shadows == ACCURATE:
            return self._shadow.accurate(frame.gbuffer, maps, records)
        return self._shadow.integrated(frame.gbuffer, maps, records, self.chosen.steps)

    def _add(self, frame: FrameInputs, index: int, visibility: moderngl.Texture | None) -> None:
        frame.gbuffer.bind()
        if self._corner_sums:
            self._corners.points.bind_to_storage_buffer(POINT_BINDING)
            self._corners.faces.bind_to_storage_buffer(FACE_BINDING)
            self._corner_sums[index].bind_to_storage_buffer(RESULT_BINDING)
        else:
            for unit, image in enumerate(self._wave_images):
                image.texture.bind_to_image(unit)
        for unit, name in enumerate(("light", "specular", "unshadowed"), start=2):
            self._images[name].texture.bind_to_image(unit)
        if visibility is not None:
            visibility.use(VISIBILITY_UNIT)
        set_uniforms(self._combine, {"has_shadows": visibility is not None})
        width, height = self._images["light"].size
        self._combine.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self.scene.context.memory_barrier()

    def specular(self) -> moderngl.Texture | None:
        """What glossy surfaces show of the lights, likewise shadowed; None where nothing is glossy."""
        return self._images["specular"].texture if self._has_specular else None

    def counters(self) -> dict[str, float]:
        """Lights, shadow maps and shadows of all lamps; what was computed anew in this frame; bytes of the maps, and
        what the seed's figure for them and the direct light's map would be (eq. 5.4)."""
        settings, chosen = self.scene.settings, self.chosen
        maps = self._map_count()
        shadows = maps
        if chosen.shadows == INTEGRATED:
            shadows = integrated_shadow_count(SPREAD_LIGHTS, chosen.steps) * len(self._waves)
        return {
            "virtual_point_lights": sum(len(wave) for wave in self._waves),
            "waves": len(self._waves),
            "waves_computed": self._store.computed,
            "indirect_shadow_maps": maps,
            "indirect_shadow_maps_drawn": self._store.drawn,
            "indirect_shadows": shadows,
            "indirect_shadow_map_bytes": shadow_map_bytes(settings.width, settings.height, self._map_scale, maps),
            "published_map_bytes": shadow_map_bytes(settings.width, settings.height, chosen.map_scale, maps + 1),
        }

    def images(self) -> dict[str, Float32]:
        """Light before shadows, what shadows leave of it (of all lamps' light together), and where the lights stand."""
        light, unshadowed = (read_image(self._images[name].texture)[..., :3] for name in ("light", "unshadowed"))
        share = np.divide(light, unshadowed, out=np.ones_like(light), where=unshadowed > 0.0)
        found = {"lightwave_unshadowed": unshadowed, "lightwave_indirect_shadow": share}
        if self._has_specular:
            found["lightwave_specular"] = read_image(self._images["specular"].texture)[..., :3]
        size = (self.scene.settings.width, self.scene.settings.height)
        places = [self.scene.space.local_points(wave.positions) for wave in self._waves] or [np.zeros((0, 3))]
        shells = [np.asarray(wave.shells) for wave in self._waves] or [np.zeros(0, int)]
        found["lightwave_lights"] = drawn_points(
            self._centred_view(), np.concatenate(places), np.concatenate(shells), size
        )
        return found

    def reasons(self) -> list[str]:
        """Why maps are smaller than asked for."""
        if self._map_scale >= self.chosen.map_scale or not self._maps:
            return []
        limit = f"the device's limits or {MOST_MAP_BYTES >> 20} MiB for {self._map_count()} maps"
        return [f"indirect shadow maps are {self._map_scale:.2f} times the picture's size, to keep {limit}"]
