# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects of a frame that come after direct and indirect light, as its plan says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..core.effects import EffectPlan, parse_choices
from ..core.errors import InvalidInput
from ..core.scene import Float32
from ..core.settings import checked_values
from .frame_types import RenderSettings
from .map_settings import MapSettings
from .passes.accumulate import PictureLight, read_image
from .passes.ambient_occlusion import AmbientOcclusionPass, OcclusionSettings
from .passes.light_mesh_reflection import LightMeshReflectionPass
from .passes.map_reflection import MapReflectionPass, MapReflectionSettings
from .passes.reflected_light import LitPicturePass, SpecularMixPass
from .passes.rsm import LampReflections
from .passes.screen_reflection import ReflectionSettings, ScreenReflectionPass
from .technique import FrameInputs, SceneInputs, Technique

if TYPE_CHECKING:
    import moderngl

SETTINGS: Mapping[str, type] = MappingProxyType(
    {
        "ambient_occlusion": OcclusionSettings,
        "screen_reflection": ReflectionSettings,
        "map_reflection": MapReflectionSettings,
    }
)
"""Of effects that have any."""
REFLECTIONS = ("screen_reflection", "map_reflection", "light_mesh_reflection")


def effect_settings(settings: RenderSettings) -> dict[str, Any]:
    """Settings of each effect in SETTINGS. Raises InvalidInput for one that is unknown or out of range."""
    _, given = parse_choices(settings.effects)
    for name in given.keys() - SETTINGS.keys():
        raise InvalidInput(f"effect {name!r}", "it has no settings", f"these have: {', '.join(SETTINGS)}")
    return {
        name: settings_type(**checked_values(settings_type, given.get(name, {}), f"effect {name!r}"))
        for name, settings_type in SETTINGS.items()
    }


class FrameEffects:
    """Passes of one frame, made when the first picture needs them."""

    def __init__(
        self, scene: SceneInputs, technique: Technique | None, settings: Mapping[str, Any], lamps: int
    ) -> None:
        """technique: None where it is left out. settings: of `effect_settings`. lamps: of the lights of `scene.world`,
        those that are not the world's."""
        self._scene = scene
        self._technique = technique
        self._settings = settings
        self._lamps = lamps
        self._passes: dict[str, Any] = {}
        self._maps: LampReflections | None = None
        self._shown: dict[str, moderngl.Texture] = {}

    def openness(self, plan: EffectPlan, frame: FrameInputs) -> moderngl.Texture | None:
        """Share of indirect light that is not occluded, in r; None for all of it."""
        if not plan.runs("ambient_occlusion"):
            return None
        settings: OcclusionSettings = self._settings["ambient_occlusion"]
        chosen = self._pass("ambient_occlusion", AmbientOcclusionPass, settings)
        maps = None if self._technique is None else self._technique.lamp_maps()
        with self._scene.timer.measure("ambient occlusion"):
            found: moderngl.Texture = chosen.render(
                frame.gbuffer,
                frame.view,
                frame.sample_index,
                maps.maps() if maps is not None else (),
                self._scene.space,
            )
        self._shown["ambient_occlusion"] = found
        return found

    def specular(self, plan: EffectPlan, frame: FrameInputs, light: PictureLight) -> moderngl.Texture | None:
        """Radiance of indirect light in glossy surfaces, rgb; None for none."""
        own = None if self._technique is None else self._technique.specular()
        if not any(plan.runs(name) for name in REFLECTIONS):
            return own
        found: dict[str, moderngl.Texture | None] = dict.fromkeys(REFLECTIONS)
        if plan.runs("screen_reflection"):
            found["screen_reflection"] = self._screen_reflection(frame, light)
        if plan.runs("map_reflection"):
            found["map_reflection"] = self._map_reflection(frame, found["screen_reflection"])
        if plan.runs("light_mesh_reflection"):
            found["light_mesh_reflection"] = self._light_mesh_reflection(frame)
        self._shown |= {name: texture for name, texture in found.items() if texture is not None}
        with self._scene.timer.measure("mix reflections"):
            mix: moderngl.Texture = self._pass("mix", SpecularMixPass).render(own, *found.values())
        return mix

    def _screen_reflection(self, frame: FrameInputs, light: PictureLight) -> moderngl.Texture:
        with self._scene.timer.measure("screen reflection"):
            lit = self._pass("lit", LitPicturePass).render(frame.gbuffer, frame.view, light)
            chosen = self._pass("screen_reflection", ScreenReflectionPass, self._settings["screen_reflection"])
            found: moderngl.Texture = chosen.render(frame.gbuffer, frame.view, lit, frame.sample_index)
        return found

    def _light_mesh_reflection(self, frame: FrameInputs) -> moderngl.Texture | None:
        lights = None if self._technique is None else self._technique.reflecting_lights()
        if lights is None:
            return None
        with self._scene.timer.measure("light mesh reflection"):
            found: moderngl.Texture = self._pass("light_mesh_reflection", LightMeshReflectionPass).render(
                frame.gbuffer, frame.view, *lights, frame.progress
            )
        return found

    def _map_reflection(self, frame: FrameInputs, known: moderngl.Texture | None) -> moderngl.Texture:
        maps = self._lamp_maps()
        with self._scene.timer.measure("map reflection"):
            found: moderngl.Texture = self._pass("map_reflection", MapReflectionPass).render(
                frame.gbuffer,
                frame.view,
                maps.maps(),
                self._scene.space,
                self._settings["map_reflection"],
                frame.sample_index,
                known,
            )
        return found

    def _lamp_maps(self) -> LampReflections:
        """Those of the technique, or drawn for effects: of lamps, not of the world."""
        if self._maps is None:
            own = None if self._technique is None else self._technique.lamp_maps()
            self._maps = own if own is not None else self._drawn_maps()
        return self._maps

    def _drawn_maps(self) -> LampReflections:
        scene = self._scene
        settings = MapSettings()
        lamps = replace(scene.world, lights=scene.world.lights[: self._lamps])
        with scene.timer.measure("reflective shadow maps"):
            maps = LampReflections(
                scene.context, scene.shaders, scene.kept, lamps, settings.resolution, settings.area_maps
            )
            maps.draw()
        return maps

    def _pass(self, name: str, make: Any, *arguments: Any) -> Any:
        """The pass of that name, made now if it is not there."""
        if name not in self._passes:
            size = self._scene.settings.width, self._scene.settings.height
            self._passes[name] = make(self._scene.context, self._scene.shaders, *size, *arguments)
        return self._passes[name]

    def images(self) -> dict[str, Float32]:
        """What effects found for the last picture, by their names."""
        return {
            name: read_image(texture)[..., : 1 if name == "ambient_occlusion" else 3]
            for name, texture in self._shown.items()
        }
