# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes of a material as one set of Principled parameters; what does not fit is reported and approximated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ...core.scene import DIFFUSE, PRINCIPLED, Float32
from .node_graph import Endpoint, node_label, source
from .node_values import NodeEvaluator, Report
from .surface_value import SurfaceValue, combine, constant_color, constant_number

BLACK = np.zeros(3, np.float32)
# What Cycles gives a face without material.
DEFAULT_COLOR = np.full(3, 0.8, np.float32)
SHINY = {"BSDF_GLOSSY": 1.0, "BSDF_METALLIC": 1.0, "BSDF_ANISOTROPIC": 1.0, "BSDF_GLASS": 0.0, "BSDF_REFRACTION": 0.0}
"""Shader nodes that become a Principled surface of this metallic value."""
MATT = ("SUBSURFACE_SCATTERING", "BSDF_TRANSLUCENT", "BSDF_SHEEN", "BSDF_VELVET", "BSDF_TOON", "BSDF_RAY_PORTAL")
"""Shader nodes that become a Diffuse surface."""
NEUTRAL_INPUTS = {
    "Transmission Weight": (0.0, "transmission is not simulated", "the surface is opaque"),
    "Subsurface Weight": (0.0, "subsurface scattering is approximated", "the base color reflects diffusely"),
    "Coat Weight": (0.0, "coat is not simulated", "it is left out"),
    "Sheen Weight": (0.0, "sheen is not simulated", "it is left out"),
    "Anisotropic": (0.0, "anisotropy is not simulated", "the highlight is round"),
    "Diffuse Roughness": (0.0, "diffuse roughness is approximated", "the base reflects as a Lambert surface"),
    "Thin Film Thickness": (0.0, "thin film is not simulated", "it is left out"),
}
"""Inputs of the Principled node that are not in the snapshot: neutral value, problem, remedy."""


@dataclass(frozen=True)
class Surface:
    """One surface as Principled parameters over the surface. `transparent`: nothing but transparency."""

    model: str
    base_color: SurfaceValue
    alpha: SurfaceValue
    roughness: SurfaceValue
    metallic: SurfaceValue
    specular_ior_level: SurfaceValue
    ior: SurfaceValue
    emission: SurfaceValue
    normal: SurfaceValue | None = None
    normal_strength: float = 1.0
    transparent: bool = False


def diffuse_surface(color: Float32) -> Surface:
    """A Lambert surface of one colour."""
    return Surface(
        model=DIFFUSE,
        base_color=constant_color(color),
        alpha=constant_number(1.0),
        roughness=constant_number(0.5),
        metallic=constant_number(0.0),
        specular_ior_level=constant_number(0.5),
        ior=constant_number(1.5),
        emission=constant_color(BLACK),
    )


class SurfaceReader:
    """Reads the shader that arrives at a material's output."""

    def __init__(self, evaluator: NodeEvaluator, report: Report) -> None:
        self._values = evaluator
        self._report = report

    def surface(self, endpoint: Endpoint, owner: str) -> Surface:
        """The surface that arrives from `endpoint`; `owner` names the material in findings."""
        if endpoint.is_constant:
            return diffuse_surface(BLACK)
        kind = endpoint.node.type
        reader = _READERS.get(kind)
        if reader is not None:
            return reader(self, endpoint, owner)
        label = node_label(owner, endpoint.node)
        if kind in SHINY:
            return self._shiny(endpoint, owner, SHINY[kind])
        if kind in MATT:
            self._report(label, f"{endpoint.node.bl_label} is approximated", "reflects diffusely")
            return replace(diffuse_surface(BLACK), base_color=self._color(endpoint, owner))
        self._report(label, f"{endpoint.node.bl_label} is not simulated", "reflects diffusely with a default gray")
        return diffuse_surface(DEFAULT_COLOR)

    def _color(self, endpoint: Endpoint, owner: str, name: str = "Color") -> SurfaceValue:
        present = {socket.name for socket in endpoint.node.inputs}
        name = name if name in present else "Base Color"
        return self._values.color(endpoint.input(name), owner) if name in present else constant_color(DEFAULT_COLOR)

    def _principled(self, endpoint: Endpoint, owner: str) -> Surface:
        label = node_label(owner, endpoint.node)
        for name, (neutral, problem, remedy) in NEUTRAL_INPUTS.items():
            if self._differs(endpoint, name, neutral, owner):
                self._report(label, problem, remedy)
        tint = self._values.color(endpoint.input("Specular Tint"), owner)
        if tint.is_textured or not np.allclose(tint.mean[:3], 1.0):
            self._report(label, "specular tint is not simulated", "the highlight of the dielectric layer is white")
        strength = self._values.number(endpoint.input("Emission Strength"), owner)
        color = self._values.color(endpoint.input("Emission Color"), owner)
        normal, normal_strength = self._normal(endpoint, owner)

        def number(name: str) -> SurfaceValue:
            return self._values.number(endpoint.input(name), owner)

        return Surface(
            model=PRINCIPLED,
            base_color=self._values.color(endpoint.input("Base Color"), owner),
            alpha=number("Alpha"),
            roughness=number("Roughness"),
            metallic=number("Metallic"),
            specular_ior_level=number("Specular IOR Level"),
            ior=number("IOR"),
            emission=self._product(color, strength, label),
            normal=normal,
            normal_strength=normal_strength,
        )

    def _differs(self, endpoint: Endpoint, name: str, neutral: float, owner: str) -> bool:
        if not any(socket.name == name for socket in endpoint.node.inputs):
            return False
        found = endpoint.input(name)
        if not found.is_constant:
            return True
        return self._values.number(found, owner).number != neutral

    def _diffuse(self, endpoint: Endpoint, owner: str) -> Surface:
        label = node_label(owner, endpoint.node)
        if self._differs(endpoint, "Roughness", 0.0, owner):
            self._report(label, "diffuse roughness is approximated", "reflects as a Lambert surface")
        normal, strength = self._normal(endpoint, owner)
        color = self._color(endpoint, owner)
        return replace(diffuse_surface(BLACK), base_color=color, normal=normal, normal_strength=strength)

    def _shiny(self, endpoint: Endpoint, owner: str, metallic: float) -> Surface:
        label = node_label(owner, endpoint.node)
        self._report(label, f"{endpoint.node.bl_label} is approximated", "shown as a Principled surface")
        normal, strength = self._normal(endpoint, owner)
        return replace(
            diffuse_surface(BLACK),
            model=PRINCIPLED,
            base_color=self._color(endpoint, owner),
            roughness=self._values.number(endpoint.input("Roughness"), owner),
            metallic=constant_number(metallic),
            normal=normal,
            normal_strength=strength,
        )

    def _emission(self, endpoint: Endpoint, owner: str) -> Surface:
        strength = self._values.number(endpoint.input("Strength"), owner)
        emission = self._product(self._color(endpoint, owner), strength, node_label(owner, endpoint.node))
        return replace(diffuse_surface(BLACK), emission=emission)

    def _transparent(self, endpoint: Endpoint, owner: str) -> Surface:
        color = self._color(endpoint, owner)
        if color.is_textured or not np.allclose(color.mean[:3], 1.0):
            self._report(node_label(owner, endpoint.node), "colored transparency is not simulated", "it is clear")
        return replace(diffuse_surface(BLACK), alpha=constant_number(0.0), transparent=True)

    def _mix(self, endpoint: Endpoint, owner: str) -> Surface:
        node, label = endpoint.node, node_label(owner, endpoint.node)
        share = self._values.number(source(node.inputs[0], endpoint.groups), owner)
        a, b = (self.surface(source(socket, endpoint.groups), owner) for socket in node.inputs[1:3])
        if a.transparent and not b.transparent:
            return replace(b, alpha=self._product(b.alpha, share, label))
        if b.transparent and not a.transparent:
            rest = self._combine("complement", lambda s: 1.0 - s, [share], label)
            return replace(a, alpha=self._product(a.alpha, rest, label))
        if _differ(a, b):
            self._report(label, "a mix of shaders is approximated", "their parameters are mixed")

        def lerp(x: SurfaceValue, y: SurfaceValue) -> SurfaceValue:
            mixed = self._combine("lerp", lambda p, q, s: p + (q - p) * s, [x, y, share], label)
            return replace(mixed, channel=0) if x.channel is not None else mixed

        mixed: dict[str, Any] = {
            f.name: lerp(getattr(a, f.name), getattr(b, f.name)) for f in fields(Surface) if f.type == _VALUE
        }
        return replace(a, model=a.model if a.model == b.model else PRINCIPLED, normal=a.normal or b.normal, **mixed)

    def _add(self, endpoint: Endpoint, owner: str) -> Surface:
        node, label = endpoint.node, node_label(owner, endpoint.node)
        a, b = (self.surface(source(socket, endpoint.groups), owner) for socket in node.inputs[:2])
        base, other = (b, a) if _only_emits(a) else (a, b)
        if not _only_emits(other):
            self._report(label, "a sum of shaders is approximated", "only the emission of the second is added")
        emission = self._combine("add", lambda x, y: x + y, [base.emission, other.emission], label)
        return replace(base, emission=emission)

    def _normal(self, endpoint: Endpoint, owner: str) -> tuple[SurfaceValue | None, float]:
        found = endpoint.input("Normal")
        if found.is_constant:
            return None, 1.0
        label = node_label(owner, found.node)
        if found.node.type != "NORMAL_MAP":
            self._report(label, f"{found.node.bl_label} is not simulated", "the mesh's own normals are used")
            return None, 1.0
        if found.node.space != "TANGENT":
            self._report(label, f"{found.node.space.lower()} normals are not simulated", "the mesh's own are used")
            return None, 1.0
        value = self._values.color(found.input("Color"), owner)
        if not value.is_textured:
            return None, 1.0
        return value, self._values.number(found.input("Strength"), owner).number

    def _product(self, a: SurfaceValue, b: SurfaceValue, label: str) -> SurfaceValue:
        product = self._combine("multiply", lambda x, y: x * y, [a, b], label, multiplies=True)
        return replace(product, channel=0) if a.channel is not None and b.channel is not None else product

    def _combine(
        self,
        name: str,
        function: Callable[..., Float32],
        values: list[SurfaceValue],
        label: str,
        multiplies: bool = False,
    ) -> SurfaceValue:
        def report(problem: str, remedy: str) -> None:
            self._report(label, problem, remedy)

        return combine(name, function, values, report, multiplies)


_VALUE = "SurfaceValue"
_READERS: dict[str, Callable[[SurfaceReader, Endpoint, str], Surface]] = {
    "BSDF_PRINCIPLED": SurfaceReader._principled,
    "BSDF_DIFFUSE": SurfaceReader._diffuse,
    "EMISSION": SurfaceReader._emission,
    "BSDF_TRANSPARENT": SurfaceReader._transparent,
    "MIX_SHADER": SurfaceReader._mix,
    "ADD_SHADER": SurfaceReader._add,
}


def _only_emits(surface: Surface) -> bool:
    color = surface.base_color
    return surface.model == DIFFUSE and color.attribute is None and not color.data[..., :3].any()


def _differ(a: Surface, b: Surface) -> bool:
    """Whether mixing the parameters of two surfaces is not the same as mixing their light."""
    if a.model == b.model == DIFFUSE:
        return False
    return a.model != b.model or any(
        getattr(a, name).key != getattr(b, name).key for name in ("roughness", "metallic", "specular_ior_level", "ior")
    )
