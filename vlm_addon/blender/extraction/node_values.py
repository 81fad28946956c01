# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and numbers of a shader node tree, evaluated texel by texel where an image is involved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.scene import Float32, Float64
from . import node_operations as operations
from .color_space import into_rec709
from .image_pixels import MISSING_COLOR, image_pixels
from .node_graph import Endpoint, node_label, source
from .surface_value import (
    IDENTITY_UV,
    Sampling,
    SurfaceValue,
    UvSource,
    as_color,
    as_number,
    combine,
    constant_color,
    constant_number,
)

Report = Callable[[str, str, str], None]
"""Takes subject, problem and remedy of one finding."""

CURVE_SAMPLES = 256


class NodeEvaluator:
    """Evaluates sockets for one extraction; images are read once.

    report takes the findings. to_rec709: (3, 3) float64 matrix from the file's working space.
    """

    def __init__(self, to_rec709: Float64, report: Report) -> None:
        self.to_rec709 = to_rec709
        self.report = report
        self._images: dict[tuple[str, bool], Float32 | None] = {}

    def color(self, endpoint: Endpoint, owner: str) -> SurfaceValue:
        """The colour that arrives from `endpoint`; `owner` names material or lamp in findings."""
        return as_color(self.value(endpoint, owner))

    def number(self, endpoint: Endpoint, owner: str) -> SurfaceValue:
        """The number that arrives from `endpoint`."""
        return as_number(self.value(endpoint, owner))

    def value(self, endpoint: Endpoint, owner: str) -> SurfaceValue:
        if endpoint.is_constant:
            return self.default(endpoint.socket)
        label = node_label(owner, endpoint.node)

        def report(problem: str, remedy: str) -> None:
            self.report(label, problem, remedy)

        handler = _HANDLERS.get(endpoint.node.type)
        if handler is None:
            report(f"{endpoint.node.bl_label} is not simulated", "replaced by one average value")
            return _average(self, endpoint, owner)
        return handler(self, endpoint, owner, report)

    def default(self, socket: Any) -> SurfaceValue:
        if socket.type == "RGBA":
            return constant_color(into_rec709(np.array(socket.default_value[:3], np.float32), self.to_rec709))
        if socket.type in ("VALUE", "INT", "BOOLEAN"):
            return constant_number(float(socket.default_value))
        if socket.type == "VECTOR":
            return constant_color(np.array(socket.default_value[:3], np.float32))
        return constant_number(0.0)

    def image(self, endpoint: Endpoint, owner: str, report: Callable[[str, str], None]) -> SurfaceValue:
        """The picture of an Image Texture node, whichever of its outputs is used."""
        node = endpoint.node
        if node.image is None:
            report("the node has no image", "choose one; shown in magenta")
            return constant_color(np.array(MISSING_COLOR, np.float32))
        straight = node.outputs["Alpha"].is_linked
        key = (node.image.name_full, straight)
        if key not in self._images:
            self._images[key] = image_pixels(node.image, self.to_rec709, straight, report)
        pixels = self._images[key]
        if pixels is None:
            return constant_color(np.array(MISSING_COLOR, np.float32))
        if node.projection != "FLAT":
            report(f"{node.projection.lower()} projection is not simulated", "the UV map is used")
        if node.extension not in ("REPEAT", "EXTEND"):
            report(f"extension {node.extension} is not simulated", "edge pixels are continued")
        uv = self._uv_source(endpoint.input("Vector"), owner)
        sampling = Sampling(uv, node.extension == "REPEAT", node.interpolation != "Closest")
        return SurfaceValue(pixels, ("image", *key), sampling)

    def environment(self, endpoint: Endpoint, owner: str, report: Callable[[str, str], None]) -> SurfaceValue:
        """The picture of an Environment Texture node: on a surface, whose directions are not known here, its mean."""
        node = endpoint.node
        report(f"{node.bl_label} is not simulated", "replaced by one average value")
        pixels = None if node.image is None else image_pixels(node.image, self.to_rec709, False, report)
        return constant_color(np.array(MISSING_COLOR, np.float32) if pixels is None else pixels.mean(axis=(0, 1)))

    def _uv_source(self, endpoint: Endpoint, owner: str) -> UvSource:
        if endpoint.is_constant:
            return UvSource()
        node, socket = endpoint.node, endpoint.socket
        label = node_label(owner, node)
        if node.type == "UVMAP":
            return UvSource(node.uv_map)
        if node.type == "TEX_COORD" and socket.name == "UV":
            return UvSource()
        if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY":
            return UvSource(node.attribute_name)
        if node.type == "MAPPING":
            upstream = self._uv_source(endpoint.input("Vector"), owner)
            matrix = self._mapping_matrix(endpoint, owner, label)
            return UvSource(upstream.uv_map, _compose(matrix, upstream.matrix))
        self.report(label, f"{socket.name} coordinates are not simulated", "the UV map is used")
        return UvSource()

    def _mapping_matrix(self, endpoint: Endpoint, owner: str, label: str) -> tuple[float, ...]:
        node = endpoint.node
        parts: dict[str, Float32] = {}
        for name, neutral in (("Location", 0.0), ("Rotation", 0.0), ("Scale", 1.0)):
            parts[name] = np.full(3, neutral, np.float32)
            if any(socket.name == name and socket.enabled for socket in node.inputs):
                parts[name] = self.color(endpoint.input(name), owner).mean[:3]
        if node.vector_type not in ("POINT", "TEXTURE") or parts["Rotation"][:2].any():
            self.report(label, "only turns about z of points and textures are simulated", "the rest is left out")
        angle = float(parts["Rotation"][2])
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        scale, location = parts["Scale"][:2].astype(np.float64), parts["Location"][:2].astype(np.float64)
        linear = turn @ np.diag(scale)
        if node.vector_type == "TEXTURE":
            linear = np.diag(1.0 / np.where(scale == 0.0, 1.0, scale)) @ turn.T
            location = -linear @ location
        return tuple(np.column_stack([linear, location]).ravel().tolist())


def _compose(outer: tuple[float, ...], inner: tuple[float, ...]) -> Any:
    def square(matrix: tuple[float, ...]) -> Float64:
        return np.vstack([np.reshape(matrix, (2, 3)), [0.0, 0.0, 1.0]])

    product = (square(outer) @ square(inner))[:2]
    return IDENTITY_UV if np.array_equal(product.ravel(), IDENTITY_UV) else tuple(product.ravel().tolist())


Handler = Callable[[NodeEvaluator, Endpoint, str, Callable[[str, str], None]], SurfaceValue]


def _image_texture(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    value = evaluator.image(endpoint, owner, report)
    return replace(value, channel=3) if endpoint.socket.name == "Alpha" else value


def _environment_texture(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    return evaluator.environment(endpoint, owner, report)


def _color_attribute(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    node = endpoint.node
    name = node.layer_name if node.type == "VERTEX_COLOR" else node.attribute_name
    if endpoint.socket.name != "Color" or (node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY"):
        report(f"output {endpoint.socket.name} is not simulated", "read as 1")
        return constant_number(1.0)
    return replace(constant_color(np.ones(3, np.float32)), attribute=name)


def _constant_output(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    return evaluator.default(endpoint.socket)


def _separate(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    node = endpoint.node
    value = evaluator.color(endpoint.input(next(s.name for s in node.inputs if s.enabled)), owner)
    if getattr(node, "mode", "RGB") != "RGB":
        report(f"separating {node.mode} is not simulated", "the luminance is used")
        return as_number(value)
    channel = [socket.name for socket in node.outputs if socket.enabled].index(endpoint.socket.name)
    return replace(value, channel=channel)


def _combine_channels(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    node = endpoint.node
    if getattr(node, "mode", "RGB") != "RGB":
        report(f"combining {node.mode} is not simulated", "read as RGB")
    values = [evaluator.number(endpoint.input(s.name), owner) for s in node.inputs if s.enabled][:3]

    def stack(red: Float32, green: Float32, blue: Float32) -> Float32:
        channels = np.broadcast_arrays(red[..., 0], green[..., 0], blue[..., 0], np.float32(1.0))
        return np.stack(channels, axis=-1)

    return combine("combine", stack, values, report)


def _grey(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    return as_number(evaluator.color(endpoint.input("Color"), owner))


def _mix(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    node = endpoint.node
    old = node.type == "MIX_RGB"
    names = ("Fac", "Color1", "Color2") if old else ("Factor", "A", "B")
    blend = "MIX" if not old and node.data_type != "RGBA" else node.blend_type
    if blend not in operations.BLENDS:
        report(f"blend type {blend} is not simulated", "mixed plainly")
        blend = "MIX"
    factor, a, b = (evaluator.value(endpoint.input(name), owner) for name in names)
    clamp_factor = old or node.clamp_factor
    clamp_result = node.use_clamp if old else node.clamp_result

    def function(factor: Float32, a: Float32, b: Float32) -> Float32:
        share = np.clip(factor, 0.0, 1.0) if clamp_factor else factor
        mixed = operations.mix(a, b, share[..., :1], blend)
        return np.clip(mixed, 0.0, 1.0) if clamp_result else mixed

    factor = as_number(factor)
    multiplies = blend == "MULTIPLY" and not factor.is_textured and factor.number == 1.0
    mixed = combine(("mix", blend, clamp_factor, clamp_result), function, [factor, a, b], report, multiplies)
    return as_number(mixed) if not old and node.data_type == "FLOAT" else mixed


def _math(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    node = endpoint.node
    if node.operation not in operations.MATHS:
        report(f"operation {node.operation} is not simulated", "its first value is used")
        return evaluator.number(source(node.inputs[0], endpoint.groups), owner)
    values = [evaluator.number(source(socket, endpoint.groups), owner) for socket in node.inputs]

    def function(a: Float32, b: Float32, c: Float32) -> Float32:
        result = operations.MATHS[node.operation](a, b, c)
        return np.clip(result, 0.0, 1.0) if node.use_clamp else result

    return as_number(combine(("math", node.operation, node.use_clamp), function, values, report))


def _color_operation(name: str, inputs: tuple[str, ...], function: Callable[..., Float32]) -> Handler:
    """A node of one colour and numbers: the numbers arrive as (..., 1)."""

    def handler(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
        values = [evaluator.color(endpoint.input("Color"), owner)]
        values += [evaluator.number(endpoint.input(_first_present(endpoint, key)), owner) for key in inputs]

        def of_arrays(color: Float32, *numbers: Float32) -> Float32:
            return function(color, *(number[..., :1] for number in numbers))

        return combine(name, of_arrays, values, report)

    return handler


def _first_present(endpoint: Endpoint, names: str) -> str:
    """The first of names separated by | that the node has: some inputs are called otherwise in other versions."""
    present = {socket.name for socket in endpoint.node.inputs}
    return next(name for name in names.split("|") if name in present)


def _color_ramp(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    ramp = endpoint.node.color_ramp
    positions = np.linspace(0.0, 1.0, CURVE_SAMPLES)
    table = np.array([ramp.evaluate(position)[:] for position in positions], np.float32)
    table[:, :3] = into_rec709(table[:, :3], evaluator.to_rec709)
    factor = evaluator.number(endpoint.input(_first_present(endpoint, "Fac|Factor")), owner)

    def function(values: Float32) -> Float32:
        scaled = values[..., 0].astype(np.float64)
        return np.stack([np.interp(scaled, positions, table[:, c]) for c in range(4)], axis=-1)

    value = combine(("ramp", table.tobytes()), function, [factor], report)
    return replace(value, channel=3) if endpoint.socket.name == "Alpha" else value


def _map_range(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    node = endpoint.node
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        report("only linear mapping of numbers is simulated", "mapped linearly")
    names = ("Value", "From Min", "From Max", "To Min", "To Max")
    values = [evaluator.number(endpoint.input(name), owner) for name in names]

    def function(value: Float32, from_min: Float32, from_max: Float32, low: Float32, high: Float32) -> Float32:
        mapped = operations.map_range(value, from_min, from_max, low, high)
        return np.clip(mapped, np.minimum(low, high), np.maximum(low, high)) if node.clamp else mapped

    return as_number(combine(("map_range", node.clamp), function, values, report))


def _clamp(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
    values = [evaluator.number(endpoint.input(name), owner) for name in ("Value", "Min", "Max")]
    return as_number(combine("clamp", np.clip, values, report))


def _average(evaluator: NodeEvaluator, endpoint: Endpoint, owner: str) -> SurfaceValue:
    """One value for a node that is not evaluated: the mean of its own colours where it has any, else a half."""
    names = [s.name for s in endpoint.node.inputs if s.enabled and s.type == "RGBA"]
    if endpoint.socket.type == "RGBA" and names:
        colors = [evaluator.color(endpoint.input(name), owner).mean for name in names]
        return constant_color(np.mean(colors, axis=0))
    return constant_number(0.5)


_HANDLERS: dict[str, Handler] = {
    "TEX_IMAGE": _image_texture,
    "TEX_ENVIRONMENT": _environment_texture,
    "VERTEX_COLOR": _color_attribute,
    "ATTRIBUTE": _color_attribute,
    "RGB": _constant_output,
    "VALUE": _constant_output,
    "SEPARATE_COLOR": _separate,
    "COMBINE_COLOR": _combine_channels,
    "RGBTOBW": _grey,
    "MIX": _mix,
    "MIX_RGB": _mix,
    "MATH": _math,
    "GAMMA": _color_operation("gamma", ("Gamma",), operations.gamma),
    "INVERT": _color_operation("invert", ("Fac|Factor",), operations.invert),
    "BRIGHTCONTRAST": _color_operation("contrast", ("Bright|Brightness", "Contrast"), operations.brightness_contrast),
    "HUE_SAT": _color_operation(
        "hue_saturation", ("Hue", "Saturation", "Value", "Fac|Factor"), operations.hue_saturation
    ),
    "VALTORGB": _color_ramp,
    "MAP_RANGE": _map_range,
    "CLAMP": _clamp,
}
