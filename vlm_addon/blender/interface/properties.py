# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings dataclasses as Blender properties, and the settings that a scene keeps."""

from __future__ import annotations

import dataclasses
from contextlib import ExitStack
from typing import Any, TypeVar

import bpy

from ...core.effect_rules import RULES
from ...core.effects import AUTO, OFF, ON
from ...core.settings import SettingInfo, describe, from_mapping
from ...core.simplify import SimplifySettings
from ...render.frame_effects import SETTINGS as EFFECT_SETTINGS
from ...render.frame_types import LIMITS, RenderSettings
from ...render.technique import Technique, technique_by_name, technique_list
from ..findings import CLASSES as FINDING_CLASSES
from ..findings import VLM_PG_finding

S = TypeVar("S")

SCENE_PROPERTY = "vlm"
MOST_SAMPLES = 4096
CHOICE_TEXTS = {AUTO: "Where the scene calls for it", ON: "Always", OFF: "Never"}
FLOAT32_DIGITS = 6
"""Significant digits of a Blender property: a limit read back from it is still within the limits."""


def property_annotations(settings_type: type) -> dict[str, Any]:
    """Blender properties, by name, for the fields of a Settings dataclass: same default, range and text."""
    return {info.name: _property(info) for info in describe(settings_type)}


def settings_from(owner: Any, settings_type: type[S]) -> S:
    """The Settings dataclass with the values of the properties of `owner`. Raises InvalidInput."""
    values = {info.name: _value(owner, info) for info in describe(settings_type)}
    return from_mapping(settings_type, values, settings_type.__name__)


def technique_settings(scene: Any, technique: str) -> dict[str, Any]:
    """Values by name of the settings that `scene` keeps for a technique. Raises InvalidInput where there is none."""
    settings_type = technique_by_name(technique).settings
    group = technique_group(scene, technique)
    return {info.name: _value(group, info) for info in describe(settings_type)} if group is not None else {}


def technique_group(scene: Any, technique: str) -> Any:
    """The properties that `scene` keeps for a technique; None for a technique without settings."""
    return getattr(getattr(scene, SCENE_PROPERTY), _group_name(technique), None)


def shown_settings(group: Any, settings_type: type) -> list[str]:
    """Names of the settings in `group` that count with the others as they are."""
    infos = {info.name: info for info in describe(settings_type)}

    def counts(name: str) -> bool:
        control = infos[name].only_with
        return control is None or (getattr(group, control[0]) == control[1] and counts(control[0]))

    return [name for name in infos if counts(name)]


def effect_values(scene: Any) -> dict[str, Any]:
    """What `scene` keeps of effects, as RenderSettings.effects has it."""
    group = getattr(scene, SCENE_PROPERTY).effects
    values: dict[str, Any] = {rule.name: getattr(group, rule.name) for rule in RULES}
    for name, settings_type in EFFECT_SETTINGS.items():
        for info in describe(settings_type):
            values[f"{name}.{info.name}"] = _value(group, info, effect_property(name, info.name))
    return values


def effect_property(effect: str, setting: str) -> str:
    """Name of the property of one setting of an effect."""
    return f"{effect}_{setting}"


def _value(owner: Any, info: SettingInfo, name: str | None = None) -> Any:
    value = getattr(owner, name or info.name)
    return float(f"{value:.{FLOAT32_DIGITS}g}") if info.type is float else value


def _property(info: SettingInfo) -> Any:
    notes = [info.unit, f"source: {info.source}" if info.source else ""]
    told = ", ".join(note for note in notes if note)
    common = {
        "name": _title(info.name),
        "description": f"{info.text} ({told})" if told else info.text,
        "default": info.default,
    }
    limits = {key: value for key, value in (("min", info.low), ("max", info.high)) if value is not None}
    if info.choices:
        return bpy.props.EnumProperty(items=[(name, _title(name), "") for name in info.choices], **common)
    if info.type is bool:
        return bpy.props.BoolProperty(**common)
    if info.type is int:
        return bpy.props.IntProperty(**common, **{key: int(value) for key, value in limits.items()})
    if info.type is float:
        return bpy.props.FloatProperty(**common, **limits, precision=4)
    return bpy.props.StringProperty(**common)


def _title(name: str) -> str:
    return name.replace("_", " ").title()


def register_scene_settings(undo: ExitStack) -> None:
    """Give scenes the property `vlm`; `undo` hears how to take it away again."""
    groups = {technique.name: _settings_group(technique) for technique in technique_list()}
    effects = _effects_group()
    scene_group = _scene_group(groups, effects)
    for cls in (*FINDING_CLASSES, effects, *filter(None, groups.values()), scene_group):
        bpy.utils.register_class(cls)
        undo.callback(bpy.utils.unregister_class, cls)
    pointer = bpy.props.PointerProperty(type=scene_group, name="Virtual Light Mesh")
    setattr(bpy.types.Scene, SCENE_PROPERTY, pointer)
    undo.callback(delattr, bpy.types.Scene, SCENE_PROPERTY)


def ensure_scene_settings() -> None:
    """Give scenes the property `vlm` for good where no extension did: in `python -m vlm_addon`."""
    if not hasattr(bpy.types.Scene, SCENE_PROPERTY):
        register_scene_settings(ExitStack())


def _group_name(technique: str) -> str:
    return f"{technique}_settings"


def _settings_group(technique: type[Technique]) -> type | None:
    annotations = property_annotations(technique.settings)
    name = f"VLM_PG_{technique.name}_settings"
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations}) if annotations else None


def _effects_group() -> type:
    annotations: dict[str, Any] = {}
    for rule in RULES:
        annotations[rule.name] = bpy.props.EnumProperty(
            name=rule.label,
            description=rule.text,
            items=[(choice, _title(choice), text) for choice, text in CHOICE_TEXTS.items()],
            default=rule.default,
        )
        settings_type = EFFECT_SETTINGS.get(rule.name)
        for info in describe(settings_type) if settings_type is not None else ():
            annotations[effect_property(rule.name, info.name)] = _property(info)
    return type("VLM_PG_effects", (bpy.types.PropertyGroup,), {"__annotations__": annotations})


def _tooltip(technique: type[Technique]) -> str:
    # Blender ends tooltips with a full stop of its own.
    return f"{technique.description}. Known bias: {technique.known_bias()}".removesuffix(".")


def _scene_group(groups: dict[str, type | None], effects: type) -> type:
    defaults = {field.name: field.default for field in dataclasses.fields(RenderSettings)}
    (target,) = (info for info in describe(SimplifySettings) if info.name == "target_triangles")
    annotations = {
        "technique": bpy.props.EnumProperty(
            name="Technique",
            description="How indirect light is computed",
            items=[(each.name, each.label, _tooltip(each)) for each in technique_list()],
            default=defaults["technique"],
        ),
        "samples": bpy.props.IntProperty(
            name="Samples",
            description="Jittered pictures that are averaged: more give smoother edges and soft shadows",
            default=defaults["samples"],
            min=1,
            max=MOST_SAMPLES,
        ),
        "world_lights": bpy.props.IntProperty(
            name="World Lights",
            description="Directions that stand for the world's light, each with a shadow map (direct light has up to "
            "four times as many): more give smoother shadows of the sky and take longer; none if the world is black",
            default=defaults["world_lights"],
            min=1,
            max=LIMITS["world_lights"],
        ),
        "target_triangles": _property(target),
        "light_budget": bpy.props.IntProperty(
            name="Light Budget",
            description="Virtual lights that all light meshes of the scene may have together: phase two takes "
            "time in proportion to them, with a light grid to those near. Check says when there are more; 0: no limit",
            default=0,
            min=0,
        ),
        "effects": bpy.props.PointerProperty(type=effects, name="Effects"),
        "findings": bpy.props.CollectionProperty(type=VLM_PG_finding, name="Findings of the last check"),
    }
    for technique, group in groups.items():
        if group is not None:
            annotations[_group_name(technique)] = bpy.props.PointerProperty(type=group)
    return type("VLM_PG_scene", (bpy.types.PropertyGroup,), {"__annotations__": annotations})
