# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups in which artists paint where a visible mesh gets more lights, or none."""

from __future__ import annotations

from typing import Any

import bpy

from .names import MORE_DETAIL_GROUP, NO_LIGHTS_GROUP

MORE, NONE = "MORE", "NONE"
CHOICES = (
    (MORE, "More Here", "Full weight: more lights than elsewhere; no weight: as everywhere"),
    (
        NONE,
        "None Here",
        "Half weight and more: no lights, so that nothing bounces here; no weight: as everywhere",
    ),
)
GROUPS = {MORE: MORE_DETAIL_GROUP, NONE: NO_LIGHTS_GROUP}


def start(context: Any, choice: str) -> str:
    """Make the group where it is missing and enter weight paint on it; returns what to do now, in words."""
    thing = context.active_object
    name = GROUPS[choice]
    group = thing.vertex_groups.get(name) or thing.vertex_groups.new(name=name)
    thing.vertex_groups.active_index = group.index
    if thing.mode != "WEIGHT_PAINT":
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    return f"Paint into {name!r} of {thing.name!r}, leave with Ctrl+Tab, then create the light mesh (again)"
