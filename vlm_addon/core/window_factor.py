# SPDX-License-Identifier: GPL-3.0-or-later
"""How much larger than its error model says the windows of a scene's clusters must be for a tolerance to hold there.

The model of `light_clusters` knows a cluster, not what stands around it: in long corridors and among tall blocks the
errors of many clusters have one sign and add up. Errors fall steeply as windows grow (to a fifth where windows are 1.4
times as large), so windows of twice the size tell the errors of others without a sum over all lights.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from .light_clusters import light_clusters
from .light_cut import cut_irradiance
from .light_mesh import VirtualLightMesh
from .light_tree import LightTree
from .metrics import point_error, within_tolerance
from .scene import Float64
from .surface_points import SurfacePoints

# Windows are compared with those that are so many steps larger.
_STEPS_TO_DOUBLE = 2
_STEPS = 6
# Of the tolerance: what errors are asked to stay within, since probes are few and larger windows err as well.
_SHARE = 0.6


def window_factor(
    trees: Sequence[LightTree],
    light_mesh: VirtualLightMesh,
    radiosity: Float64,
    tolerance: float,
    mean_irradiance: float,
    probes: SurfacePoints,
) -> float:
    """At least 1 and at most 8, in steps of sqrt(2): what windows are to be multiplied by; 1 without probes.

    trees: that together hold all lights. radiosity: (n, 3) W/m². mean_irradiance: as `light_clusters`. Each channel
    counts for itself, since a cluster sends out one mean colour.
    """
    if not trees or not len(probes.positions):
        return 1.0

    @cache
    def irradiance(step: int) -> Float64:
        """(p, 3) W/m²."""
        total = np.zeros((len(probes.positions), 3))
        for tree in trees:
            clusters = light_clusters(tree, light_mesh, radiosity, tolerance, mean_irradiance, _factor(step))
            cut = cut_irradiance(
                tree, clusters, light_mesh, radiosity, probes.positions, probes.normals, probes.tag_ids
            )
            total += cut.irradiance
        return total

    def holds(step: int) -> bool:
        errors = point_error(irradiance(step), irradiance(step + _STEPS_TO_DOUBLE))
        return within_tolerance(errors, _SHARE * tolerance)

    return _factor(next((step for step in range(_STEPS) if holds(step)), _STEPS))


def _factor(step: int) -> float:
    return float(2.0 ** (step / _STEPS_TO_DOUBLE))
