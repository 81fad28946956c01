# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects of a frame that come after direct and indirect light, as its plan says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.effects import EffectPlan, parse_choices
from ..core.errors import InvalidInput
from ..core.scene import Float32
from ..core.settings import checked_values
from .effect_history import EffectHistory
from .frame_types import RenderSettings
from .map_settings import MapSettings
from .passes.accumulate import PictureLight, read_image
from .passes.ambient_occlusion import AmbientOcclusionPass, OcclusionSettings
from .passes.light_mesh_reflection import LightMeshReflectionPass
from .passes.map_reflection import MapReflectionPass, MapReflectionSettings
from .passes.reflected_light import LitPicturePass, SpecularMixPass
from .passes.rsm import LampReflections
from .passes.screen_reflection import ReflectionSettings, ScreenReflectionPass
from .passes.temporal_accumulation import AccumulationSettings
from .technique import FrameInputs, SceneInputs, Technique

if TYPE_CHECKING:
    import moderngl

SETTINGS: Mapping[str, type] = MappingProxyType(
    {
        "ambient_occlusion": OcclusionSettings,
        "screen_reflection": ReflectionSettings,
        "map_reflection": MapReflectionSettings,
        "temporal_accumulation": AccumulationSettings,
    }
)
"""Of effects that have any."""
REFLECTIONS = ("screen_reflection", "map_reflection", "light_mesh_reflection")


def checked_effects(values: Mapping[str, Any]) -> dict[str, Any]:
    """`values` of RenderSettings.effects (numbers, or texts as typed on a command line), each of its setting's type.

    Raises InvalidInput for an effect, a choice or a setting that there is not, or a value out of range.
    """
    choices, given = parse_choices(values)
    for name in given.keys() - SETTINGS.keys():
        raise InvalidInput(f"effect {name!r}", "it has no settings", f"these have: {', '.join(SETTINGS)}")
    checked = {name: checked_values(SETTINGS[name], values, f"effect {name!r}") for name, values in given.items()}
    return choices | {f"{name}.{key}": value for name, found in checked.items() for key, value in found.items()}


def effect_settings(settings: RenderSettings) -> dict[str, Any]:
    """Settings of each effect in SETTINGS. Raises InvalidInput as `checked_effects`."""
    _, given = parse_choices(checked_effects(settings.effects))
    return {name: settings_type(**given.get(name, {})) for name, settings_type in SETTINGS.items()}


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
        self._history: EffectHistory | None = None

    def openness(self, plan: EffectPlan, frame: FrameInputs) -> moderngl.Texture | None:
        """Share of indirect light that is not occluded, in r; None for all of it."""
        if not plan.computes("ambient_occlusion"):
            return None
        settings: OcclusionSettings = self._settings["ambient_occlusion"]
        chosen = self._pass("ambient_occlusion", AmbientOcclusionPass, settings)
        maps = None if self._technique is None else self._technique.lamp_maps()

        def find(index: int) -> moderngl.Texture:
            with self._scene.timer.measure("ambient occlusion"):
                views = maps.maps() if maps is not None else ()
                found: moderngl.Texture = chosen.render(frame.gbuffer, frame.view, index, views, self._scene.space)
            return found

        found = self._found("ambient_occlusion", plan, frame, find, follows_eye=False)
        return found if plan.runs("ambient_occlusion") else None

    def _found(
        self,
        name: str,
        plan: EffectPlan,
        frame: FrameInputs,
        find: Callable[[int], moderngl.Texture],
        *,
        follows_eye: bool,
    ) -> moderngl.Texture:
        """What `find` makes of the number of a picture, with what was found before where the plan says so."""
        if plan.runs("temporal_accumulation"):
            if self._history is None:
                self._history = EffectHistory(self._scene, self._settings["temporal_accumulation"])
            found = find(self._history.picture(name, follows_eye=follows_eye))
            found = self._history.mean(name, frame, found, self._scene.kept.digests.of(self._settings[name]))
        else:
            found = find(frame.sample_index)
        self._shown[name] = found
        return found

    def specular(self, plan: EffectPlan, frame: FrameInputs, light: PictureLight) -> moderngl.Texture | None:
        """Radiance of indirect light in glossy surfaces, rgb; None for none."""
        own = None if self._technique is None else self._technique.specular()
        if not any(plan.computes(name) for name in REFLECTIONS):
            return own
        found: dict[str, moderngl.Texture | None] = dict.fromkeys(REFLECTIONS)
        if plan.computes("screen_reflection"):
            found["screen_reflection"] = self._screen_reflection(plan, frame, light)
        if plan.computes("map_reflection"):
            found["map_reflection"] = self._map_reflection(plan, frame)
        if plan.computes("light_mesh_reflection"):
            found["light_mesh_reflection"] = self._light_mesh_reflection(frame)
        wanted = (texture if plan.runs(name) else None for name, texture in found.items())
        with self._scene.timer.measure("mix reflections"):
            mix: moderngl.Texture = self._pass("mix", SpecularMixPass).render(own, *wanted)
        return mix

    def _screen_reflection(self, plan: EffectPlan, frame: FrameInputs, light: PictureLight) -> moderngl.Texture:
        chosen = self._pass("screen_reflection", ScreenReflectionPass, self._settings["screen_reflection"])

        def find(index: int) -> moderngl.Texture:
            with self._scene.timer.measure("screen reflection"):
                lit = self._pass("lit", LitPicturePass).render(frame.gbuffer, frame.view, light)
                found: moderngl.Texture = chosen.render(frame.gbuffer, frame.view, lit, index)
            return found

        return self._found("screen_reflection", plan, frame, find, follows_eye=True)

    def _light_mesh_reflection(self, frame: FrameInputs) -> moderngl.Texture | None:
        lights = None if self._technique is None else self._technique.reflecting_lights()
        if lights is None:
            return None
        with self._scene.timer.measure("light mesh reflection"):
            found: moderngl.Texture = self._pass("light_mesh_reflection", LightMeshReflectionPass).render(
                frame.gbuffer, frame.view, *lights, frame.progress
            )
        self._shown["light_mesh_reflection"] = found
        return found

    def _map_reflection(self, plan: EffectPlan, frame: FrameInputs) -> moderngl.Texture:
        """For the rays that the screen, asked before, has not found."""
        maps, settings = self._lamp_maps(), self._settings["map_reflection"]
        known = self._passes["screen_reflection"].found if plan.computes("screen_reflection") else None
        chosen = self._pass("map_reflection", MapReflectionPass)

        def find(index: int) -> moderngl.Texture:
            with self._scene.timer.measure("map reflection"):
                found: moderngl.Texture = chosen.render(
                    frame.gbuffer, frame.view, maps.maps(), self._scene.space, settings, index, known
                )
            return found

        return self._found("map_reflection", plan, frame, find, follows_eye=True)

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
        found = {
            name: np.ascontiguousarray(read_image(texture)[..., : 1 if name == "ambient_occlusion" else 3])
            for name, texture in self._shown.items()
        }
        return found | ({} if self._history is None else self._history.images())
