# SPDX-License-Identifier: GPL-3.0-or-later
"""What the surfaces in reflective shadow maps reflect, and which part of them each map has to itself."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.scene import Float64

if TYPE_CHECKING:
    from .passes.rsm import ReflectiveShadowMap


@dataclass(frozen=True)
class MapFluxes:
    """Of some maps, in their order.

    flux: (m, 3) float64 W, what each map's surfaces reflect. shares: (m,) float64, of the surfaces in a map, which it
    lights for its lamp or for the world: the other maps of these show much the same surfaces. brightest: (3,) float64
    W/m², what no irradiance exceeds.
    """

    flux: Float64
    shares: Float64
    brightest: Float64

    @property
    def powers(self) -> Float64:
        """(m,) float64 W: mean of the channels."""
        return np.asarray(self.flux.mean(axis=1), np.float64)


def measured_fluxes(maps: Iterable[ReflectiveShadowMap]) -> MapFluxes:
    """Reads the coarsest levels of all maps; waits for the device."""
    flux, shares, brightest, is_world = [], [], np.zeros(3), []
    for found in maps:
        flux.append(found.total_flux() * found.space.unit**2)
        shares.append(float(found.record["sample_weight"][0]))
        brightest += found.brightest
        is_world.append(float(found.record["world_solid_angle"][0]) > 0.0)
    measured = MapFluxes(np.array(flux).reshape(-1, 3), np.array(shares), brightest)
    of_world = measured.powers[is_world].sum()
    alike = np.array(is_world, bool) & (measured.powers > 0.0)
    measured.shares[alike] = measured.powers[alike] / of_world
    return measured
