# SPDX-License-Identifier: GPL-3.0-or-later
"""How much larger than its error model says the windows of a scene's clusters must be for a tolerance to hold there.

The model of `light_clusters` knows a cluster, not what stands around it: in long corridors and among tall blocks the
errors of many clusters have one sign and add up. Errors fall steeply as windows grow (to a fifth where windows are 1.4
times as large), so windows of twice the size tell the errors of others without a sum over all lights.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .light_clusters import light_clusters
from .light_cut import cut_irradiance
from .light_mesh import VirtualLightMesh
from .light_scale import mean_irradiance
from .light_tree import LightTree
from .metrics import point_error, within_tolerance
from .scene import Float64
from .surface_points import SurfacePoints

# Windows are compared with those that are so many steps larger.
_STEPS_TO_DOUBLE = 2
_STEPS = 6
# Of the tolerance: what errors are asked to stay within, as the probes are few and those of the double window count.
_SHARE = 0.75
# No wall of a building faces it squarely.
_SUN = np.array([0.48, 0.6, 0.64])


def window_factor(
    trees: Sequence[LightTree], light_mesh: VirtualLightMesh, tolerance: float, probes: SurfacePoints
) -> float:
    """At least 1 and at most 8, in steps of sqrt(2): what windows are to be multiplied by; 1 without probes.

    Found under two lights that are the same whatever lamps do, so that relighting keeps it: even light at every other
    probe, a sun that shines through walls at the others.
    """
    if not trees or len(probes.positions) < 2:
        return 1.0
    judged = np.zeros(len(light_mesh), bool)
    judged[np.concatenate([tree.light_order for tree in trees])] = True
    even = np.where(judged[:, None], light_mesh.nominal_radiosity, 0.0)
    facing = light_mesh.area_vectors @ _SUN
    sizes = np.maximum(np.linalg.norm(light_mesh.area_vectors, axis=1), np.finfo(float).tiny)
    sunlit = even * np.maximum(facing / sizes, 0.0)[:, None]
    lights = [
        _Windows(trees, light_mesh, radiosity, tolerance, probes.rows(slice(start, None, 2)))
        for start, radiosity in enumerate((even, sunlit))
    ]
    step = 0
    while step < _STEPS and not all(light.holds(step) for light in lights):
        step += 1
    return _factor(step)


def _factor(step: int) -> float:
    return float(2.0 ** (step / _STEPS_TO_DOUBLE))


class _Windows:
    """Irradiance of probes under one light, by the size of the windows."""

    def __init__(
        self,
        trees: Sequence[LightTree],
        light_mesh: VirtualLightMesh,
        radiosity: Float64,
        tolerance: float,
        probes: SurfacePoints,
    ) -> None:
        self._inputs = light_mesh, radiosity
        self._trees, self._tolerance, self._probes = trees, tolerance, probes
        self._mean = mean_irradiance(trees, light_mesh, radiosity, probes)
        self._found: dict[int, Float64] = {}

    def holds(self, step: int) -> bool:
        """Whether windows of this step keep the tolerance."""
        errors = point_error(self._irradiance(step), self._irradiance(step + _STEPS_TO_DOUBLE))
        return within_tolerance(errors, _SHARE * self._tolerance)

    def _irradiance(self, step: int) -> Float64:
        """(p,) W/m², sum over the channels."""
        if step not in self._found:
            total = np.zeros(len(self._probes.positions))
            for tree in self._trees:
                clusters = light_clusters(tree, *self._inputs, self._tolerance, self._mean, _factor(step))
                cut = cut_irradiance(
                    tree, clusters, *self._inputs, self._probes.positions, self._probes.normals, self._probes.tag_ids
                )
                total += cut.irradiance.sum(axis=1)
            self._found[step] = total
        return self._found[step]
