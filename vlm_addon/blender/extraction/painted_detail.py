# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists paint on a visible mesh: where the next light mesh gets more lights, and where none."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.scene import Float32, Int32
from ..names import MORE_DETAIL_GROUP, NO_LIGHTS_GROUP

MOST_DETAIL = 4.0
"""About how many times as many lights full weight gives."""

NONE_FROM = 0.5
"""Mean weight of a triangle's corners from which it has no lights."""


def painted_detail(blender_object: Any, mesh: Any, triangles: Int32) -> Float32:
    """(t,) `Mesh.detail` of the triangles of an evaluated mesh, (0,) where neither vertex group is there.

    mesh: of `blender_object`, evaluated. triangles: (t, 3) into its vertices. A loop runs over the vertices of a mesh
    with such a group: Blender gives weights one by one.
    """
    groups = [blender_object.vertex_groups.get(name) for name in (MORE_DETAIL_GROUP, NO_LIGHTS_GROUP)]
    if not any(groups):
        return np.zeros(0, np.float32)
    more, none = (_weights(mesh, group)[triangles].mean(axis=1) for group in groups)
    detail = 1.0 + (MOST_DETAIL - 1.0) * more
    return np.where(none >= NONE_FROM, 0.0, detail).astype(np.float32)


def _weights(mesh: Any, group: Any | None) -> Float32:
    """(v,) weights in a vertex group, 0 for vertices outside of it."""
    weights = np.zeros(len(mesh.vertices), np.float32)
    if group is not None:
        wanted = group.index
        for row, vertex in enumerate(mesh.vertices):
            for element in vertex.groups:
                if element.group == wanted:
                    weights[row] = element.weight
    return weights
