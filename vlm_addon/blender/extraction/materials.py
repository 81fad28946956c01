# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of the visible surfaces as Principled or Diffuse parameters and textures in linear Rec.709."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.scene import NO_TEXTURE, Finding, Float64, Material, Texture
from .color_space import into_rec709
from .node_graph import node_label, node_tree_of, source
from .node_values import NodeEvaluator
from .surface_value import IDENTITY_UV, SurfaceValue, UvSource
from .surfaces import BLACK, DEFAULT_COLOR, Surface, SurfaceReader, diffuse_surface

DEFAULT_MATERIAL = "default"


@dataclass(frozen=True)
class MaterialUse:
    """What a mesh needs to know to use a material: its index, texture coordinates and colour attribute."""

    index: int
    uv: UvSource
    color_attribute: str | None


class FindingList:
    """Collects findings, each once, in order."""

    def __init__(self) -> None:
        self._found: dict[Finding, None] = {}

    def __call__(self, subject: str, problem: str, remedy: str) -> None:
        self._found.setdefault(Finding(subject, problem, remedy))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was collected."""
        return tuple(self._found)


class MaterialTable:
    """Materials and textures of one extraction, each once."""

    def __init__(self, to_rec709: Float64, report: FindingList) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self.evaluator = NodeEvaluator(to_rec709, report)
        self._to_rec709 = to_rec709
        self._report = report
        self._uses: dict[str | None, MaterialUse] = {}
        self._texture_indices: dict[Hashable, int] = {}

    def use(self, material: Any | None) -> MaterialUse:
        """How to use a Blender material; None for a face that has none, which Cycles shows in its default grey."""
        key = None if material is None else material.name_full
        if key not in self._uses:
            name = DEFAULT_MATERIAL if material is None else material.name_full
            surface = diffuse_surface(DEFAULT_COLOR) if material is None else self._surface(material)
            self._uses[key] = self._add(name, surface)
        return self._uses[key]

    def _surface(self, material: Any) -> Surface:
        owner = f"material {material.name!r}"
        tree = node_tree_of(material)
        if tree is None:
            return diffuse_surface(into_rec709(np.array(material.diffuse_color[:3], np.float32), self._to_rec709))
        output = tree.get_output_node("CYCLES")
        if output is None:
            self._report(owner, "it has no output node", "it is black, as in Cycles")
            return diffuse_surface(BLACK)
        for name in ("Volume", "Displacement"):
            if output.inputs[name].is_linked:
                self._report(node_label(owner, output), f"{name.lower()} is not simulated", "it is left out")
        return SurfaceReader(self.evaluator, self._report).surface(source(output.inputs["Surface"]), owner)

    def _add(self, name: str, surface: Surface) -> MaterialUse:
        owner = f"material {name!r}"
        channels: dict[str, Any] = {}
        for field_name in ("alpha", "roughness", "metallic"):
            value = getattr(surface, field_name)
            channels[field_name], channels[f"{field_name}_texture"] = self._number(value)
            channels[f"{field_name}_channel"] = value.channel
        base_color, base_color_texture = self._color(surface.base_color)
        emission, emission_texture = self._color(surface.emission)
        if surface.emission.attribute is not None:
            self._report(owner, "emission from a color attribute is not simulated", "read as white")
        for field_name in ("ior", "specular_ior_level"):
            if getattr(surface, field_name).is_textured:
                self._report(owner, f"a texture in {field_name} is not simulated", "its mean is used")
        self.materials.append(
            Material(
                name=name,
                model=surface.model,
                base_color=base_color,
                base_color_texture=base_color_texture,
                base_color_from_corners=surface.base_color.attribute is not None,
                emission=emission,
                emission_texture=emission_texture,
                ior=surface.ior.number,
                specular_ior_level=surface.specular_ior_level.number,
                normal_texture=NO_TEXTURE if surface.normal is None else self._texture(surface.normal),
                normal_strength=surface.normal_strength,
                **channels,
            )
        )
        uv = self._shared_uv(owner, surface)
        return MaterialUse(len(self.materials) - 1, uv, surface.base_color.attribute)

    def _shared_uv(self, owner: str, surface: Surface) -> UvSource:
        """The texture coordinates of the first texture; others that differ are reported."""
        values = (surface.base_color, surface.normal, surface.roughness, surface.metallic, surface.alpha)
        samplings = [value.sampling for value in (*values, surface.emission) if value is not None]
        sources = [sampling.uv for sampling in samplings if sampling is not None]
        if len(set(sources)) > 1:
            self._report(owner, "its textures use different coordinates", "all are placed as the first")
        if sources and surface.normal is not None and sources[0].matrix != IDENTITY_UV:
            a, b, _, c, d, _ = sources[0].matrix
            if b or c or a <= 0.0 or d <= 0.0:
                self._report(owner, "a turned normal map is approximated", "its directions turn with it")
        return sources[0] if sources else UvSource()

    def _color(self, value: SurfaceValue) -> tuple[tuple[float, float, float], int]:
        if value.is_textured:
            return (1.0, 1.0, 1.0), self._texture(value)
        red, green, blue = value.data[:3].tolist()
        return (red, green, blue), NO_TEXTURE

    def _number(self, value: SurfaceValue) -> tuple[float, int]:
        return (1.0, self._texture(value)) if value.is_textured else (value.number, NO_TEXTURE)

    def _texture(self, value: SurfaceValue) -> int:
        assert value.sampling is not None
        repeat, linear_filter = value.sampling.repeat, value.sampling.linear_filter
        key = (value.key, repeat, linear_filter)
        if key not in self._texture_indices:
            self._texture_indices[key] = len(self.textures)
            pixels = np.ascontiguousarray(value.data, np.float32)
            self.textures.append(Texture(_texture_name(value.key), pixels, repeat, linear_filter))
        return self._texture_indices[key]


def _texture_name(key: Any) -> str:
    """The image's name, or that of the first image that went into it."""
    if isinstance(key, tuple):
        if key and key[0] == "image":
            return str(key[1])
        return next((name for name in map(_texture_name, key[1:]) if name), "")
    return ""
