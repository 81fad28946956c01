# SPDX-License-Identifier: GPL-3.0-or-later
"""Does a triangle meet a cube? By separating axes (Akenine-Moeller 2001), closed: what touches meets.

Triangles without area are the segments or points that they look like: axes of length zero separate nothing.
`gpu_shaders/lib/triangle_box.glsl` is the same in float32.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .scene import Float64

Bools = npt.NDArray[np.bool_]

# Six roundings in a component of the normal and in its share of the height.
_PLANE_ROUNDING = 6.0 * 2.0**-53


def triangles_meet_cubes(corners: Float64, centres: Float64, half: float) -> Bools:
    """(n,) whether triangle i of (n, 3, 3) corners and the cube of side 2 `half` around (n, 3) centre i have a point in
    common. Those that miss each other by some 1e-13 of the coordinates or less may count as meeting, never the reverse
    but for as much."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    meets = ((low <= centres + half) & (high >= centres - half)).all(axis=1)
    rows = np.flatnonzero(meets)
    local = corners[rows] - centres[rows, None, :]
    meets[rows] = _plane_meets(local, half) & _silhouettes_meet(local, half)
    return meets


def _plane_meets(local: Float64, half: float) -> Bools:
    """Whether the triangle's plane meets the cube."""
    sides = local[:, 1] - local[:, 0], local[:, 2] - local[:, 0]
    normal = np.cross(*sides)
    height = np.abs(np.einsum("ij,ij->i", normal, local[:, 0]))
    # Of three points in a line the normal is nothing but rounding and says nothing.
    longest = [np.abs(side).max(axis=1) for side in sides]
    rounding = _PLANE_ROUNDING * longest[0] * longest[1] * np.abs(local[:, 0]).sum(axis=1)
    return np.asarray(height <= half * np.abs(normal).sum(axis=1) + rounding)


def _silhouettes_meet(local: Float64, half: float) -> Bools:
    """Whether triangle and cube overlap along the nine axes across an edge and a coordinate axis."""
    meets = np.ones(len(local), bool)
    for first in range(3):
        a, b, c = (local[:, (first + corner) % 3] for corner in range(3))
        edge = b - a
        for u, v in ((0, 1), (1, 2), (2, 0)):
            on_edge = edge[:, u] * a[:, v] - edge[:, v] * a[:, u]
            opposite = edge[:, u] * c[:, v] - edge[:, v] * c[:, u]
            reach = half * (np.abs(edge[:, u]) + np.abs(edge[:, v]))
            meets &= (np.minimum(on_edge, opposite) <= reach) & (np.maximum(on_edge, opposite) >= -reach)
    return meets
