# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings dataclasses as Blender properties, and the settings that a scene keeps."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import bpy

from ..core.settings import SettingInfo, describe, from_mapping
from ..core.simplify import SimplifySettings
from ..render.frame_types import RenderSettings
from ..render.technique import technique_list

S = TypeVar("S")

SCENE_PROPERTY = "vlm"
MOST_SAMPLES = 4096


def property_annotations(settings_type: type) -> dict[str, Any]:
    """Blender properties, by name, for the fields of a Settings dataclass: same default, range and text."""
    return {info.name: _property(info) for info in describe(settings_type)}


def settings_from(owner: Any, settings_type: type[S]) -> S:
    """The Settings dataclass with the values of the properties of `owner`. Raises InvalidInput."""
    names = [info.name for info in describe(settings_type)]
    return from_mapping(settings_type, {name: getattr(owner, name) for name in names}, settings_type.__name__)


def _property(info: SettingInfo) -> Any:
    unit = f" ({info.unit})" if info.unit else ""
    common = {"name": _title(info.name), "description": f"{info.text}{unit}", "default": info.default}
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


class VLM_PG_finding(bpy.types.PropertyGroup):  # noqa: N801 (Blender's naming of classes)
    """One sentence of the last check."""

    text: bpy.props.StringProperty(name="Finding")  # type: ignore[valid-type]


def scene_property_classes() -> tuple[type, ...]:
    """The property groups in order of registration; `register` puts the last one at `scene.vlm`."""
    defaults = {field.name: field.default for field in dataclasses.fields(RenderSettings)}
    (target,) = (info for info in describe(SimplifySettings) if info.name == "target_triangles")
    annotations = {
        "technique": bpy.props.EnumProperty(
            name="Technique",
            description="How indirect light is computed",
            items=[(each.name, each.label, each.description) for each in technique_list()],
            default=defaults["technique"],
        ),
        "samples": bpy.props.IntProperty(
            name="Samples",
            description="Jittered pictures that are averaged: more give smoother edges and soft shadows",
            default=defaults["samples"],
            min=1,
            max=MOST_SAMPLES,
        ),
        "target_triangles": _property(target),
        "findings": bpy.props.CollectionProperty(type=VLM_PG_finding, name="Findings of the last check"),
    }
    return VLM_PG_finding, type("VLM_PG_scene", (bpy.types.PropertyGroup,), {"__annotations__": annotations})
