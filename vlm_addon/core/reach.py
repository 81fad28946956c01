# SPDX-License-Identifier: GPL-3.0-or-later
"""What a lamp can shine on at all, whatever stands in between."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from .scene import AREA, SPOT, Float64, Light

Bools = npt.NDArray[np.bool_]

BOUNDED_KINDS = (AREA, SPOT)
"""Lamps that do not shine everywhere."""
WIDEST_HALF_ANGLE = math.radians(89.0)
"""Of half a SPOT's cone: a wider one counts as the half space before the lamp."""
MARGIN = 1e-6
"""A box counts as inside while it is outside by less than this share of its distance: what rounding may move."""


def in_reach(light: Light, corners: Float64) -> Bools:
    """Which boxes, (n, 8, 3) corners in the lamp's space, are not wholly outside of what `light` can shine on: the half
    space before an AREA lamp, the pyramid around a SPOT's cone (of each point of its ball), everything for others."""
    inside = np.ones(len(corners), bool)
    if light.kind not in BOUNDED_KINDS:
        return inside
    towards = corners - np.array(light.position)
    local = towards @ np.array([light.x_axis, light.y_axis, light.z_axis]).T
    slack = MARGIN * np.linalg.norm(towards, axis=2).max(axis=1, initial=0.0)
    soft = light.radius if light.kind == SPOT else 0.0
    inside &= local[..., 2].min(axis=1) < slack + soft
    if light.kind == SPOT and 0.5 * light.spot_angle < WIDEST_HALF_ANGLE:
        tangent = math.tan(0.5 * light.spot_angle)
        for axis, scale in enumerate(light.spot_scale):
            steep = tangent * scale
            for sign in (1.0, -1.0):
                beyond = sign * local[..., axis] + steep * local[..., 2]
                inside &= beyond.min(axis=1) < slack + soft * math.hypot(1.0, steep)
    return inside


def box_corners(low: Float64, high: Float64) -> Float64:
    """(8, 3) corners of the box between two corners, (3,) each."""
    return np.array([np.where(bits, high, low) for bits in np.ndindex(2, 2, 2)])
