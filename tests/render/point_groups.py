# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of points of surfaces, as shaders that walk for many at once know them."""

from __future__ import annotations

import numpy as np

from tests.form_factor_cases import single, unit

Array = np.ndarray

PREAMBLE = """
PointGroup group_of(vec3 centre, vec3 extent, vec3 axis, vec3 bounds) {
    return PointGroup(centre, extent, axis, bounds.x, bounds.y, bounds.z);
}
"""
GROUP = "group_of(group_centre, extent, axis, bounds)"
"""Of `group_inputs`, for files that include `lib/light_classes.glsl`."""


def group_inputs(points: Array, normals: Array) -> dict[str, Array]:
    """What GROUP takes, of groups of (g, p, 3) points with unit normals."""
    axes = single(unit(normals.sum(axis=1)))
    along = np.einsum("gpc,gc->gp", points, axes)
    cosines = np.einsum("gpc,gc->gp", normals, axes)
    low, high = points.min(axis=1), points.max(axis=1)
    return {
        "group_centre": 0.5 * (low + high),
        "extent": 0.5 * (high - low),
        "axis": axes,
        "bounds": np.stack([along.min(1), along.max(1), cosines.min(1)], axis=-1),
    }
