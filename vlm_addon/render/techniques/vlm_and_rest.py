# SPDX-License-Identifier: GPL-3.0-or-later
"""The light mesh for chosen objects, another technique for the rest of the scene (seed 002, 3.5)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.bounce_parts import DYNAMIC, TAGGED, Choice, Reflected, tag_spans
from ...core.progress import Progress
from ...core.scene import Float32
from ...core.scene_facts import OWN_SPECULAR, TechniqueFacts
from ...core.settings import describe, setting
from ..passes.accumulate import read_image
from ..passes.phase_two import IrradianceImage
from ..scene_parts import PartTimer, chosen_inputs, kept_reflected, rest_inputs
from ..technique import FrameInputs, SceneInputs, Technique
from . import vlm
from .direct import Direct
from .lightwave import LightWave
from .many_light import ManyLight
from .rsm_gather import RsmGather
from .scaled_direct import ScaledDirect
from .second_order import SecondOrder
from .vlm import VirtualLightMeshTechnique

if TYPE_CHECKING:
    import moderngl

    from ..virtual_lights import GpuVirtualLights

OTHERS: tuple[type[Technique], ...] = (
    ManyLight,
    RsmGather,
    SecondOrder,
    VirtualLightMeshTechnique,
    LightWave,
    ScaledDirect,
    Direct,
)
"""What the rest may bounce by: every other technique."""
WITHOUT_SURFACES = (LightWave.name, ScaledDirect.name)
"""Of those, techniques whose light comes from lamps alone: no surface can be taken out of them."""
BY_LIGHTS_ALONE = (VirtualLightMeshTechnique.name, Direct.name)
"""Techniques in which no surface bounces by itself, so that none is missing or counted twice."""
MOST_NAMES = 5
CHOSEN, REST, SHOWN = "chosen", "rest", "shown"
MOST_APART = 2.0
"""Times that chosen lights may reflect more, or less, than chosen surfaces before it is told."""
GROUP_SIDE = 8


@dataclass(frozen=True)
class Division:
    """Who bounces by what."""

    chosen: str = setting(
        DYNAMIC,
        "",
        None,
        None,
        "Objects that bounce by the light mesh: those that move or deform, or surfaces and lights with certain tags",
        source="002, 3.5: specific objects with dynamic geometry",
        choices=(DYNAMIC, TAGGED),
    )
    tags: str = setting(
        "",
        "tag ids",
        None,
        None,
        "Of what bounces by the light mesh, with commas between, spans such as 3-5 too",
        source="002, 3.4",
        only_with=("chosen", TAGGED),
    )
    rest: str = setting(
        ManyLight.name,
        "",
        None,
        None,
        "Technique by which everything else bounces; its own settings begin with its name",
        source="002, 3.5",
        choices=tuple(technique.name for technique in OTHERS),
    )


def _settings_of_others() -> Iterator[tuple[str, Any, Any]]:
    """Fields for make_dataclass: the settings of each technique under its name, shown with it alone."""
    for technique in OTHERS:
        for field in dataclasses.fields(technique.settings):
            inner = field.metadata["only_with"]
            outer = (REST, technique.name) if inner is None else (_own_name(technique, inner[0]), inner[1])
            metadata = {**field.metadata, "only_with": outer}
            yield (
                _own_name(technique, field.name),
                type(field.default),
                dataclasses.field(default=field.default, metadata=metadata),
            )


def _own_name(technique: type[Technique], name: str) -> str:
    return f"{technique.name}_{name}"


def _second(settings: Any) -> tuple[type[Technique], Any]:
    """The technique of the rest and its own settings."""
    technique = next(technique for technique in OTHERS if technique.name == settings.rest)
    own = {info.name: getattr(settings, _own_name(technique, info.name)) for info in describe(technique.settings)}
    return technique, technique.settings(**own)


Settings = dataclasses.make_dataclass("Settings", _settings_of_others(), bases=(vlm.Settings, Division), frozen=True)


class VlmAndRest(Technique):
    """One bounce off chosen objects by their virtual lights, and the bounce off all else by another technique.

    Known bias: that of both techniques, each for its part. Light that bounces off a chosen object and then off another
    surface, or the other way round, is missing, whatever number of bounces the other technique has. A chosen surface
    without virtual lights does not bounce; lights that stand for surfaces which are not chosen are counted twice. What
    is faked from the lamps alone (lightwave, scaled_direct) stands for all surfaces, the chosen ones too.
    """

    name = "vlm_and_rest"
    label = "Light mesh for some, another for the rest"
    description = "Moving or tagged objects bounce by the light mesh, everything else by another technique"
    settings = Settings
    needs_light_mesh = True

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """Those of both parts: where one of them knows what is occluded, nothing else may darken the sum."""
        second, own = _second(settings)
        chosen, rest = VirtualLightMeshTechnique.facts(settings), second.facts(own)
        return replace(
            chosen,
            name=cls.name,
            knows_visibility=chosen.knows_visibility or rest.knows_visibility,
            asks_visibility=chosen.asks_visibility or rest.asks_visibility,
            bounces_without_lights=not rest.has_reflecting_lights,
            specular=rest.specular if rest.specular == OWN_SPECULAR else chosen.specular,
        )

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        assert scene.light_mesh is not None
        assert scene.world_lights is not None
        choice = Choice(settings.chosen, tag_spans(settings.tags))
        self._reflected = kept_reflected(scene, choice)
        self._parts: dict[str, Technique] = {}
        self._found: dict[str, moderngl.Texture] = {}
        self._shown: tuple[GpuVirtualLights, moderngl.Buffer] | None = None
        second, own = _second(settings)
        chosen_progress, rest_progress = _halves(scene.progress)
        if self._reflected.lights:
            inputs = replace(chosen_inputs(scene, choice, CHOSEN), progress=chosen_progress)
            self._parts[CHOSEN] = VirtualLightMeshTechnique(inputs, settings)
        inputs = replace(rest_inputs(scene, choice, REST), progress=rest_progress)
        self._has_rest = _has_rest(second, self._reflected, inputs)
        if self._has_rest:
            self._parts[REST] = second(inputs, own)
        size = scene.settings.width, scene.settings.height
        self._sum = IrradianceImage(scene.context, *size)
        self._add = scene.shaders.compute("techniques/vlm_and_rest.comp", {"GROUP_SIDE": GROUP_SIDE})

    def indirect(self, frame: FrameInputs) -> moderngl.Texture | None:
        """Light off what is chosen, and off the rest."""
        progresses = _halves(frame.progress) if len(self._parts) > 1 else (frame.progress,)
        self._found = {}
        for (name, part), progress in zip(self._parts.items(), progresses, strict=False):
            texture = part.indirect(replace(frame, progress=progress))
            if texture is not None:
                self._found[name] = texture
        if len(self._found) < len((CHOSEN, REST)):
            return next(iter(self._found.values()), None)
        with self.scene.timer.measure("add both parts"):
            self._sum.texture.bind_to_image(0, read=False, write=True)
            for unit, texture in enumerate(self._found.values(), 1):
                texture.bind_to_image(unit, read=True, write=False)
            self._add.run(*(-(-side // GROUP_SIDE) for side in self._sum.size))
            self.scene.context.memory_barrier()
        return self._sum.texture

    def specular(self) -> moderngl.Texture | None:
        """That of the other technique."""
        return self._parts[REST].specular() if REST in self._parts else None

    def reflecting_lights(self) -> tuple[GpuVirtualLights, moderngl.Buffer] | None:
        """All lights of the light mesh: no diffuse light is counted twice by what shows in glossy surfaces."""
        if self._shown is None:
            kept = self.scene.kept.part(SHOWN)
            inputs = replace(self.scene, kept=kept, timer=PartTimer(self.scene.timer, SHOWN))
            self._shown = VirtualLightMeshTechnique(inputs, vlm.Settings(lights=vlm.ALL)).reflecting_lights()
        return self._shown

    def counters(self) -> dict[str, float]:
        """Chosen triangles; those of each part."""
        found = {f"{name}_{key}": value for name, part in self._parts.items() for key, value in part.counters().items()}
        return {"chosen_triangles": self._reflected.triangles, **found}

    def images(self) -> dict[str, Float32]:
        """Irradiance of each part in the last picture, and what each part shows."""
        found = {
            f"{name}_irradiance": np.ascontiguousarray(read_image(texture)[..., :3])
            for name, texture in self._found.items()
        }
        for name, part in self._parts.items():
            own = f"{part.name}_"
            found |= {f"{name}_{key.removeprefix(own)}": image for key, image in part.images().items()}
        return {f"{self.name}_{key}": image for key, image in found.items()}

    def reasons(self) -> list[str]:
        """What is chosen, what is missing or counted twice, and what the parts say."""
        found = _balance_texts(self._reflected, self.chosen)
        if not self._has_rest:
            found.append(f"nothing is left for {self.chosen.rest}: everything is chosen")
        elif self.chosen.rest in WITHOUT_SURFACES and self._reflected.lights:
            found.append(f"{self.chosen.rest} stands for the bounce of all surfaces, the chosen ones too")
        return found + [f"{name}: {text}" for name, part in self._parts.items() for text in part.reasons()]


def _has_rest(second: type[Technique], chosen: Reflected, inputs: SceneInputs) -> bool:
    """Whether anything is left for the second technique."""
    if second.needs_light_mesh:
        return bool(inputs.light_mesh)
    return chosen.triangles < chosen.all_triangles or second.name in WITHOUT_SURFACES


def _halves(progress: Progress) -> tuple[Progress, Progress]:
    return (
        lambda done, label: progress(0.5 * done, label),
        lambda done, label: progress(0.5 + 0.5 * done, label),
    )


def _balance_texts(chosen: Reflected, settings: Any) -> list[str]:
    """What is chosen, and whether lights and surfaces that are chosen go together."""
    kind = "moves" if settings.chosen == DYNAMIC else f"has one of the tags {settings.tags or '(none given)'}"
    names = ", ".join(chosen.names[:MOST_NAMES])
    if len(chosen.names) > MOST_NAMES:
        names += f" and {len(chosen.names) - MOST_NAMES:,} more"
    if not chosen.triangles and not chosen.lights:
        return [f"nothing {kind}: all bounces by {settings.rest}"]
    found = [f"{names or 'nothing'} bounces by {chosen.lights:,} virtual lights, all else by {settings.rest}"]
    if settings.rest in BY_LIGHTS_ALONE:
        return found
    if not chosen.lights:
        return [f"no virtual light {kind}: the bounce off {names} is missing"]
    if not chosen.triangles:
        return [f"no surface {kind}: the light of {chosen.lights:,} virtual lights is counted twice"]
    low, high = sorted((chosen.of_surfaces, chosen.of_lights))
    if high > MOST_APART * low:
        is_missing = chosen.of_lights < chosen.of_surfaces
        found.append(
            f"the chosen virtual lights reflect as much as {chosen.of_lights:.3g} m² of white, the chosen surfaces "
            f"{chosen.of_surfaces:.3g} m²: light is {'missing' if is_missing else 'counted twice, or artificial'}"
        )
    return found
