# SPDX-License-Identifier: GPL-3.0-or-later
"""Random light meshes for tests of the light grid."""

from __future__ import annotations

import numpy as np

from tests.render.rooms import lights_from_triangles
from vlm_addon.core.light_mesh import VirtualLightMesh


def random_lights(seed: int, count: int = 40) -> VirtualLightMesh:
    """Triangles of very different sizes in a box of some metres: askew, along the axes, slivers, without area."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1.0, 1.0, (count, 3)) * rng.uniform(0.2, 4.0, 3)
    corners = centres[:, None] + rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(-2.0, 0.0, (count, 1, 1))
    kinds = rng.integers(0, 6, count)
    for light in np.flatnonzero(kinds == 0):
        axis = rng.integers(3)
        corners[light, :, axis] = np.round(centres[light, axis], 1)
    for light in np.flatnonzero(kinds == 1):
        corners[light] = np.round(corners[light] * 2.0) / 2.0
    corners[kinds == 2, 2] = corners[kinds == 2, 1] + 1e-6 * rng.normal(size=((kinds == 2).sum(), 3))
    return lights_from_triangles(corners)
