# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of a tolerance: how much irradiance the surface receives in the mean."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .light_clusters import light_clusters, room_irradiance
from .light_cut import cut_irradiance
from .light_mesh import VirtualLightMesh
from .light_tree import LightTree
from .scene import Float64
from .surface_points import SurfacePoints

PROBES = 200
"""Random points of the surface at which the mean is measured: it is known within some tenths."""
# The mean is measured with clusters of this tolerance.
_COARSE = 0.1
# Of a closed room's mean: light that meets no surface at all is no reason to ask for no error at all.
_LEAST_SHARE = 1e-2
# One step moves windows by some 4 % at most.
_STEPS_PER_DOUBLING = 8


def mean_irradiance(
    trees: Sequence[LightTree], light_mesh: VirtualLightMesh, radiosity: Float64, probes: SurfacePoints
) -> float:
    """W/m², sum over the channels: what `probes` receive from the trees, at most what they would in a closed room.

    radiosity: (n, 3) W/m² of all lights of the mesh. Most of the light may miss every surface: that of a roof under the
    sun does. Rounded down to a step, so that light that changes a little changes no cluster by it.
    """
    room = room_irradiance(light_mesh, radiosity)
    if not room > 0.0:
        return 0.0
    mean = room
    if len(probes.positions):
        found = 0.0
        for tree in trees:
            clusters = light_clusters(tree, light_mesh, radiosity, _COARSE, room)
            cut = cut_irradiance(
                tree, clusters, light_mesh, radiosity, probes.positions, probes.normals, probes.tag_ids
            )
            found += float(cut.irradiance.sum(axis=1).mean())
        mean = min(max(found, _LEAST_SHARE * room), room)
    return 2.0 ** (math.floor(_STEPS_PER_DOUBLING * math.log2(mean)) / _STEPS_PER_DOUBLING)
