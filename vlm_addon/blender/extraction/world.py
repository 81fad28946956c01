# SPDX-License-Identifier: GPL-3.0-or-later
"""What the world sends: the same from everywhere, or by direction as an environment texture says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mathutils import Euler

from ...core.environment import resized_map
from ...core.scene import Environment, Float32, Float64
from . import node_operations
from .color_space import into_rec709
from .image_pixels import MISSING_COLOR, image_pixels
from .materials import FindingList
from .node_graph import Endpoint, node_label, node_tree_of, source
from .node_values import NodeEvaluator
from .surface_value import Sampling, SurfaceValue, UvSource, combine, constant_color, constant_number

MOST_WIDTH = 2048
"""Columns of a map; larger pictures are averaged to this, which is still finer than a shadow shows."""
RAY_VISIBILITY = ("camera", "diffuse", "glossy")
UNTURNED = tuple(np.eye(3).ravel().tolist())
LEAST_LENGTH = 1e-6
"""Of a mapping's scale: below, it has no inverse."""

Rgb = tuple[float, float, float]
BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class DirectionSampling(Sampling):
    """An equirectangular picture. map_from_world: rows of the rotation from world space into it, one after another."""

    map_from_world: tuple[float, ...] = UNTURNED


class _WorldEvaluator(NodeEvaluator):
    """Evaluates sockets of a world: its pictures are looked up by direction."""

    def environment(self, endpoint: Endpoint, owner: str, report: Any) -> SurfaceValue:
        """The picture of an Environment Texture node in its own pixels, at most MOST_WIDTH wide."""
        node = endpoint.node
        missing = constant_color(np.array(MISSING_COLOR, np.float32))
        if node.image is None:
            report("the node has no image", "choose one; shown in magenta")
            return missing
        pixels = image_pixels(node.image, self.to_rec709, False, report)
        if pixels is None:
            return missing
        if node.projection != "EQUIRECTANGULAR":
            report(f"{node.projection.lower().replace('_', ' ')} projection is not simulated", "read as a panorama")
        height, width = pixels.shape[:2]
        if width > MOST_WIDTH:
            pixels = resized_map(pixels, max(height * MOST_WIDTH // width, 1), MOST_WIDTH).astype(np.float32)
        rotation = self._rotation(endpoint.input("Vector"), owner)
        sampling = DirectionSampling(UvSource(), True, True, tuple(rotation.ravel().tolist()))
        return SurfaceValue(pixels, ("environment", node.image.name_full), sampling)

    def _rotation(self, endpoint: Endpoint, owner: str) -> Float64:
        """(3, 3) from directions in world space to those that arrive from `endpoint`."""
        if endpoint.is_constant:
            return np.eye(3)
        node, name = endpoint.node, endpoint.socket.name
        if node.type == "TEX_COORD" and name == "Generated":
            return np.eye(3)
        if node.type == "MAPPING":
            return self._mapping(endpoint, owner) @ self._rotation(endpoint.input("Vector"), owner)
        label = node_label(owner, node)
        self.report(label, f"{name} coordinates are not simulated", "the direction is used")
        return np.eye(3)

    def _mapping(self, endpoint: Endpoint, owner: str) -> Float64:
        node = endpoint.node
        values = {"Location": np.zeros(3), "Rotation": np.zeros(3), "Scale": np.ones(3)}
        for socket in node.inputs:
            if socket.enabled and socket.name in values:
                found = self.color(source(socket, endpoint.groups), owner).mean[:3]
                values[socket.name] = found.astype(np.float64)
        turn = np.array(Euler(values["Rotation"].tolist(), "XYZ").to_matrix(), np.float64)
        scale = values["Scale"]
        moves = node.vector_type in ("POINT", "TEXTURE") and values["Location"].any()
        # A scale that is the same along all axes leaves directions as they are.
        if moves or scale.min() < LEAST_LENGTH or np.ptp(scale) > LEAST_LENGTH * scale.max():
            self.report(node_label(owner, node), "only turns of a world are simulated", "the rest is left out")
        return turn.T if node.vector_type == "TEXTURE" else turn


def read_world(world: Any | None, to_rec709: Float64, report: FindingList) -> tuple[Rgb, Environment | None]:
    """Radiance in linear Rec.709, W/(m² sr): the same from everywhere, and what comes on top of it by direction.

    Black where there is no world.
    """
    if world is None:
        return BLACK, None
    owner = f"world {world.name!r}"
    _report_visibility(world, owner, report)
    evaluator = _WorldEvaluator(to_rec709, report)
    tree = node_tree_of(world)
    if tree is None:
        return _rgb(into_rec709(np.array(world.color, np.float32), to_rec709)), None
    output = tree.get_output_node("CYCLES")
    if output is None:
        return BLACK, None
    if output.inputs["Volume"].is_linked:
        report(node_label(owner, output), "volumes are not simulated", "it is left out")
    sent = _sent(source(output.inputs["Surface"]), owner, evaluator)
    if not isinstance(sent.sampling, DirectionSampling):
        return _rgb(_cleaned(sent.mean[:3], owner, report)), None
    turn = np.reshape(sent.sampling.map_from_world, (3, 3))
    return BLACK, Environment(world.name, _cleaned(sent.data[..., :3], owner, report), turn)


def _sent(endpoint: Endpoint, owner: str, evaluator: _WorldEvaluator) -> SurfaceValue:
    """Radiance of the shader that arrives from `endpoint`."""
    black = constant_color(np.zeros(3, np.float32))
    if endpoint.is_constant:
        return black
    node = endpoint.node
    label = node_label(owner, node)

    def report(problem: str, remedy: str) -> None:
        evaluator.report(label, problem, remedy)

    if node.type in ("BACKGROUND", "EMISSION"):
        values = [evaluator.color(endpoint.input("Color"), owner), evaluator.number(endpoint.input("Strength"), owner)]
        return combine("strength", lambda color, strength: color * strength[..., :1], values, report)
    if node.type in ("ADD_SHADER", "MIX_SHADER"):
        first, second = (
            _sent(source(socket, endpoint.groups), owner, evaluator)
            for socket in node.inputs
            if socket.type == "SHADER"
        )
        if node.type == "ADD_SHADER":
            return combine("add", np.add, [first, second], report)
        factor = _factor(source(node.inputs[0], endpoint.groups), owner, evaluator)
        return combine("mix", _mixed, [factor, first, second], report)
    report(f"{node.bl_label} is not simulated", "the world is black")
    return black


def _mixed(factor: Float32, first: Float32, second: Float32) -> Float32:
    return node_operations.mix(first, second, np.clip(factor[..., :1], 0.0, 1.0), "MIX")


def _factor(endpoint: Endpoint, owner: str, evaluator: _WorldEvaluator) -> SurfaceValue:
    """Of a Mix Shader; a Light Path node is read as for light that falls on surfaces."""
    if not endpoint.is_constant and endpoint.node.type == "LIGHT_PATH":
        label = node_label(owner, endpoint.node)
        lights_surfaces = endpoint.socket.name == "Is Diffuse Ray"
        evaluator.report(label, "the world is the same for all rays here", "what lights surfaces is shown, too")
        return constant_number(1.0 if lights_surfaces else 0.0)
    return evaluator.number(endpoint, owner)


def _cleaned(radiance: Float32, owner: str, report: FindingList) -> Float32:
    """Radiance without what is not a number, infinite (as much as the brightest that is not) or below 0."""
    finite = np.isfinite(radiance)
    broken = ~finite | (radiance < 0.0)
    if not broken.any():
        return np.ascontiguousarray(radiance, np.float32)
    most = float(radiance.max(where=finite, initial=0.0))
    count = int(broken.any(axis=-1).sum())
    report(
        owner, f"it sends light that is not finite or below 0 from {count} texels", "limited to what its others send"
    )
    clean = np.nan_to_num(radiance, nan=0.0, posinf=most, neginf=0.0)
    return np.ascontiguousarray(np.maximum(clean, 0.0), np.float32)


def _report_visibility(world: Any, owner: str, report: FindingList) -> None:
    visibility = getattr(world, "cycles_visibility", None)
    if visibility is not None and not all(getattr(visibility, name, True) for name in RAY_VISIBILITY):
        report(owner, "ray visibility is not simulated", "it lights every surface and shows everywhere")


def _rgb(color: Float32) -> Rgb:
    red, green, blue = color.tolist()
    return red, green, blue
