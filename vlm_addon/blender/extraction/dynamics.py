# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an object moves or deforms between frames."""

from __future__ import annotations

from typing import Any

SIMULATIONS = {"CLOTH", "SOFT_BODY", "FLUID", "OCEAN", "WAVE", "EXPLODE", "DYNAMIC_PAINT", "PARTICLE_SYSTEM"}
"""Modifiers that change with time by themselves."""


def _animated(data_block: Any) -> bool:
    """Whether a data block has an action, drivers or NLA strips."""
    animation = getattr(data_block, "animation_data", None)
    if animation is None:
        return False
    return bool(animation.action is not None or len(animation.drivers) or len(animation.nla_tracks))


def is_dynamic(blender_object: Any, seen: frozenset[str] = frozenset()) -> bool:
    """Whether the (original) object, its data, shape keys, parents, constraint or modifier targets are animated."""
    name = blender_object.name_full
    if name in seen:
        return False
    seen |= {name}
    data = blender_object.data
    if any(map(_animated, (blender_object, data, getattr(data, "shape_keys", None)))):
        return True
    if blender_object.rigid_body is not None and blender_object.rigid_body.type == "ACTIVE":
        return True
    if any(_moves(modifier, seen) for modifier in blender_object.modifiers):
        return True
    targets = [getattr(constraint, "target", None) for constraint in blender_object.constraints if not constraint.mute]
    if blender_object.pose is not None:
        targets += [getattr(c, "target", None) for bone in blender_object.pose.bones for c in bone.constraints]
    return any(is_dynamic(target, seen) for target in (blender_object.parent, *targets) if target is not None)


def _moves(modifier: Any, seen: frozenset[str]) -> bool:
    if modifier.type in SIMULATIONS:
        return True
    if modifier.type == "NODES" and _animated(modifier.node_group):
        return True
    targets = (getattr(modifier, name, None) for name in ("object", "target", "mirror_object", "offset_object"))
    return any(is_dynamic(target, seen) for target in targets if target is not None)
