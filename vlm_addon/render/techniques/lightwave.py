# SPDX-License-Identifier: GPL-3.0-or-later
"""LightWave: indirect light faked by direct light of lights that stand around each lamp (seed 000).

Taken over: hemispheres of rays and shells (3.3, eq. 4.1), attenuation (eq. 4.2), emission over 240 degrees, cosine at
the receiver, the specular term without attenuation and the division by the count (eq. 4.5), the product with the share
of shadow maps that see (eq. 4.9), maps of lights picked by chance, and pairs of five maps with steps between (eq. 4.8).

Made to fit what is measured in W/m²: the seed's lamp is as bright everywhere, ours is so at its mean distance to the
end of the scene, and each ray carries what the lamp sends that way, with its colour; its highlight is Phong's, ours
that of the surface's own layer, blurred by what a ray stands for. Where the seed leaves it open: maps of single lights
look along their normals over 120 degrees or more, those integrated between all look along the lamp's axis, and only
lights inside the scene's bounds have maps, since outer walls hide all from the others. Not taken over: lights packed
into the range of 0 to 1 (eq. 4.3 and 4.4), which textures of floats do not need.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.light_wave import Wave, WaveSettings
from ...core.progress import Progress
from ...core.scene import DIFFUSE, Float32
from ...core.scene_facts import OWN_SPECULAR, TechniqueFacts
from ...core.settings import OWN, setting
from ...core.stacked_hemispheres import shadow_map_bytes
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
from ..point_picture import DIMMED, palette, with_points
from ..shader_library import set_uniforms
from ..technique import FrameInputs, SceneInputs, Technique
from ..view import View, make_view
from ..wave_corners import GpuCorners, corners_key, find_corners
from ..wave_shadows import ACCURATE, INTEGRATED, NONE, WaveShadows, WaveShadowSettings
from ..wave_store import WaveStore

if TYPE_CHECKING:
    import moderngl

CORNERS, PIXELS = "corners", "pixels"
VISIBILITY_UNIT = 10
WITH_ACCURATE, WITH_INTEGRATED = ("shadows", ACCURATE), ("shadows", INTEGRATED)


@dataclass(frozen=True)
class Settings:
    """How many lights, where their light is computed and how it is shadowed."""

    angle: float = setting(
        5.0, "degrees", 2.0, 90.0, "Between neighboring rays of lights around a lamp", source="000, 3.3"
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
        source=OWN,
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
    description = "Bounced light faked by lights on hemispheres around each lamp; no color bleeds, nothing is physical"
    settings = Settings

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """What it finds by itself."""
        return TechniqueFacts(cls.name, specular=OWN_SPECULAR, knows_visibility=True)

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        context, shaders, size = scene.context, scene.shaders, (scene.settings.width, scene.settings.height)
        self._store = WaveStore(scene.kept)
        glossy = any(material.model != DIFFUSE for material in scene.snapshot.materials) or not scene.snapshot.materials
        self._has_specular = settings.specular and glossy
        self._waves = self._found_waves()
        self._sum = WaveLightPass(context, shaders, self._has_specular)
        self._gpu_waves = [upload_wave(context, wave, scene.space, settings.strength) for wave in self._waves]
        shadows = WaveShadowSettings(settings.shadows, settings.maps, settings.steps, settings.map_scale)
        self._shadows = WaveShadows(scene, self._store, self._waves, shadows)
        self._images = {name: IrradianceImage(context, *size) for name in ("light", "specular", "unshadowed")}
        self._wave_images = [IrradianceImage(context, *size) for _ in range(2)]
        defines = {**WAVE_DEFINES, "VISIBILITY_UNIT": VISIBILITY_UNIT, "AT_CORNERS": settings.computed_at == CORNERS}
        self._combine = shaders.compute("techniques/lightwave.comp", defines)
        self._frame: FrameInputs | None = None
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

    def _sum_at_corners(self) -> None:
        scene = self.scene
        meshes = scene.snapshot.meshes
        corners = scene.kept.get(
            "lightwave_corners", corners_key(meshes, scene.kept.digests), lambda: find_corners(meshes)
        )
        self._corners = GpuCorners(scene.context, corners, meshes, scene.geometry.origin)
        view = self._centred_view()
        with scene.timer.measure("wave of light"):
            self._corner_sums = [
                self._sum.at_corners(scene.geometry, self._corners, wave, view, self._part(scene.progress, index))
                for index, wave in enumerate(self._gpu_waves)
            ]

    def _part(self, progress: Progress, index: int) -> Progress:
        """Progress of one wave's part of the work."""
        count = len(self._gpu_waves)
        return lambda fraction, label: progress((index + fraction) / count, label)

    def _centred_view(self) -> View:
        camera, settings = self.scene.snapshot.camera, self.scene.settings
        assert camera is not None
        return make_view(camera, settings.width, settings.height, self.scene.geometry.origin)

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the waves of their light times the share that their maps see (eq. 4.9)."""
        self._frame = frame
        for image in self._images.values():
            image.clear()
        for index, wave in enumerate(self._gpu_waves):
            if self.chosen.computed_at == PIXELS:
                with self.scene.timer.measure("wave of light"):
                    light, specular = self._wave_images
                    self._sum.at_pixels(
                        frame.gbuffer, wave, frame.view, light, specular, self._part(frame.progress, index)
                    )
            visibility = self._shadows.visibility(frame.gbuffer, index)
            with self.scene.timer.measure("combine"):
                self._add(frame, index, visibility)
        return self._images["light"].texture

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
        settings, shadows = self.scene.settings, self._shadows
        maps = shadows.map_count
        return {
            "virtual_point_lights": sum(len(wave) for wave in self._waves),
            "waves": len(self._waves),
            "waves_computed": self._store.computed,
            "indirect_shadow_maps": maps,
            "indirect_shadow_maps_drawn": self._store.drawn,
            "indirect_shadows": shadows.shadow_count,
            "indirect_shadow_map_bytes": shadows.nbytes(),
            "published_map_bytes": shadow_map_bytes(settings.width, settings.height, self.chosen.map_scale, maps + 1),
        }

    def images(self) -> dict[str, Float32]:
        """Light before shadows, what shadows leave of it (of all lamps' light together), and where the lights stand."""
        light, unshadowed = (read_image(self._images[name].texture)[..., :3] for name in ("light", "unshadowed"))
        share = np.divide(light, unshadowed, out=np.ones_like(light), where=unshadowed > 0.0)
        found = {"lightwave_unshadowed": unshadowed, "lightwave_indirect_shadow": share}
        if self._has_specular:
            found["lightwave_specular"] = read_image(self._images["specular"].texture)[..., :3]
        if self._frame is not None:
            found["lightwave_lights"] = self._drawn_lights(self._frame)
        return found

    def _drawn_lights(self, frame: FrameInputs) -> Float32:
        """The base colour, dimmed, and over it the lights, a colour for each shell."""
        image = DIMMED * read_image(frame.gbuffer.base_color)[..., :3]
        for wave in self._waves:
            image = with_points(image, frame.view, self.scene.space.local_points(wave.positions), palette(wave.shells))
        return image

    def reasons(self) -> list[str]:
        """Why maps are smaller than asked for, and where pixels would be done sooner than corners."""
        settings = self.scene.settings
        pixels = settings.width * settings.height * settings.samples
        if not self._corner_sums or self._corners.count <= pixels:
            return self._shadows.reasons()
        slow = f"light is computed at {self._corners.count:,} corners, more than there are pixels"
        return [*self._shadows.reasons(), f"{slow}; try computed_at={PIXELS}"]
