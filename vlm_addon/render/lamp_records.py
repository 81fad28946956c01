# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps as the shaders see them: positions from the local origin, everything computed in float64 before rounding."""

from __future__ import annotations

import math

import numpy as np

from ..core.lamps import LEAST_BLEND, LEAST_SPOT_SCALE, LampSample, area_of
from ..core.scene import AREA, POINT, SPOT, SUN, Float64, Light
from .gpu_layout import CONSTANTS, LAMP

_MAX_CORNERS = 8


def lamp_record(light: Light, sample: LampSample, origin: Float64) -> np.ndarray:
    """(1,) record of LAMP without shadow map. origin: (3,) float64, world space."""
    record = LAMP.zeros(1)
    at_infinity = light.kind == SUN
    record["kind"] = CONSTANTS[f"LAMP_{light.kind}"]
    record["position"] = np.array(light.z_axis) if at_infinity else np.array(light.position) - origin
    record["sample_position"] = sample.position if at_infinity else sample.position - origin
    record["sample_weight"] = sample.share
    record["shadow_scale"] = 1.0
    power = np.array(light.power, np.float64)
    for name in ("x_axis", "y_axis", "z_axis"):
        record[name] = getattr(light, name)
    if light.kind in (POINT, SPOT):
        record["intensity"] = power / (4.0 * math.pi)
        record["radius"] = light.radius
        record["falloff_radius_squared"] = light.radius**2 if light.soft_falloff else 0.0
    if light.kind == SPOT:
        cos_half = math.cos(0.5 * light.spot_angle)
        record["spot_cos_half"] = cos_half
        record["spot_sharpness"] = 1.0 / max((1.0 - cos_half) * light.spot_blend, LEAST_BLEND)
        record["spot_scale"] = np.maximum(light.spot_scale, LEAST_SPOT_SCALE)
    if light.kind == SUN:
        record["intensity"] = power
        if light.from_world:
            record["world_solid_angle"] = 4.0 * math.pi * math.sin(0.25 * light.angle) ** 2
        else:
            record["radius"] = math.sin(0.5 * light.angle)
        _set_axes(record, sample.position)
    if light.kind == AREA:
        area = area_of(light) * sample.share
        record["intensity"] = power / area if area > 0.0 else 0.0
        _set_cell(record, sample.cell)
    return record


def _set_axes(record: np.ndarray, direction: Float64) -> None:
    """Axes about `direction` as z, for the shadow map of a sun."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    x_axis = np.cross(helper, direction)
    x_axis /= np.linalg.norm(x_axis)
    record["x_axis"], record["y_axis"], record["z_axis"] = x_axis, np.cross(direction, x_axis), direction


def _set_cell(record: np.ndarray, cell: Float64) -> None:
    corners = np.concatenate([cell, np.repeat(cell[-1:], _MAX_CORNERS - len(cell), axis=0)])
    for pair in range(_MAX_CORNERS // 2):
        record[f"corners_{2 * pair}{2 * pair + 1}"] = corners[2 * pair : 2 * pair + 2].ravel()
    x, y = cell.T
    record["corner_count"] = len(cell)
    record["cell_area"] = 0.5 * abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    record["cell_centre"] = cell.mean(axis=0)
    record["cell_radius"] = np.linalg.norm(cell - cell.mean(axis=0), axis=1).max()
