# SPDX-License-Identifier: GPL-3.0-or-later
"""The background of a scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from .color_space import convert
from .materials import FindingList
from .node_graph import node_label, node_tree_of, source
from .node_values import NodeEvaluator


def read_world(world: Any | None, evaluator: NodeEvaluator, report: FindingList) -> tuple[float, float, float]:
    """Radiance of the background in linear Rec.709, W/(m² sr); black where there is no world."""
    if world is None:
        return 0.0, 0.0, 0.0
    owner = f"world {world.name!r}"
    radiance = _radiance(world, owner, evaluator, report)
    if any(radiance):
        report(owner, "light from the world is not simulated yet", "it is shown as background only")
    return radiance


def _radiance(world: Any, owner: str, evaluator: NodeEvaluator, report: FindingList) -> tuple[float, float, float]:
    tree = node_tree_of(world)
    if tree is None:
        red, green, blue = convert(np.array(world.color, np.float32), evaluator.to_rec709).tolist()
        return red, green, blue
    output = tree.get_output_node("CYCLES")
    if output is None:
        return 0.0, 0.0, 0.0
    if output.inputs["Volume"].is_linked:
        report(node_label(owner, output), "volumes are not simulated", "it is left out")
    found = source(output.inputs["Surface"])
    if found.is_constant:
        return 0.0, 0.0, 0.0
    if found.node.type != "BACKGROUND":
        report(node_label(owner, found.node), f"{found.node.bl_label} is not simulated", "the background is black")
        return 0.0, 0.0, 0.0
    color = evaluator.color(found.input("Color"), owner)
    strength = evaluator.number(found.input("Strength"), owner).number
    red, green, blue = (color.mean[:3] * strength).tolist()
    return red, green, blue
