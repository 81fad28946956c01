# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of virtual point lights: small lit pieces of surface that send their flux on by Lambert's law.

The oracle of lib/vpl.glsl. With flux P (W) on a piece of A (m²), distance d and the cosines c at the receiver and c'
at the light, irradiance is P c c' / (pi d²). That grows without bound where surfaces meet, because the piece is taken
for a point. P c c' / (pi d² + A) does not: it is what a disk of that area sends to a point on its axis, never exceeds
the piece's own radiosity P / A, and is the same from far away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import InvalidInput
from .scene import Float64

_POINTS_AT_ONCE = 256


@dataclass(frozen=True)
class VirtualPointLights:
    """positions, normals: (n, 3) float64, m and unit. flux: (n, 3), W. areas: (n,), m²."""

    positions: Float64
    normals: Float64
    flux: Float64
    areas: Float64


@dataclass(frozen=True)
class VplIrradiance:
    """What virtual point lights bring to points. irradiance: (p, 3) float64, W/m², with the bounded term. removed:
    (p, 3), W/m², what the bound takes off the unbounded term; infinite where a point touches a light."""

    irradiance: Float64
    removed: Float64


def vpl_irradiance(points: Float64, normals: Float64, lights: VirtualPointLights) -> VplIrradiance:
    """Irradiance at `points` with unit `normals`, (p, 3) float64 each, without occlusion.

    Raises InvalidInput for negative flux or area, or for numbers that are not finite.
    """
    _require_usable(lights)
    bounded, removed = np.zeros((len(points), 3)), np.zeros((len(points), 3))
    for first in range(0, len(points), _POINTS_AT_ONCE):
        part = slice(first, first + _POINTS_AT_ONCE)
        towards = lights.positions[None] - points[part, None]
        squared = (towards**2).sum(-1)
        # Cosines times the distance: a point that touches a light receives nothing of it.
        received = np.maximum((towards * normals[part, None]).sum(-1), 0.0)
        emitted = np.maximum(-(towards * lights.normals[None]).sum(-1), 0.0)
        facing = np.divide(received * emitted, squared, out=np.zeros_like(squared), where=squared > 0.0)
        reach = np.pi * squared
        lit = facing > 0.0
        with np.errstate(over="ignore"):
            kept = np.divide(facing, reach + lights.areas, out=np.zeros_like(facing), where=lit)
            lost = kept * np.divide(lights.areas, reach, out=np.zeros_like(facing), where=lit)
        bounded[part], removed[part] = kept @ lights.flux, lost @ lights.flux
    return VplIrradiance(bounded, removed)


def _require_usable(lights: VirtualPointLights) -> None:
    values = (lights.positions, lights.normals, lights.flux, lights.areas)
    if not all(np.isfinite(value).all() for value in values):
        raise InvalidInput("virtual point lights", "a value is not finite", "remove that light")
    if (lights.flux < 0.0).any() or (lights.areas < 0.0).any():
        raise InvalidInput("virtual point lights", "negative flux or area", "give values from 0")
