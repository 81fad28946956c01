# SPDX-License-Identifier: GPL-3.0-or-later
"""What techniques that ask the octree for visibility have in common."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.settings import OWN, setting
from ..core.voxel_frame import RESOLUTIONS


@dataclass(frozen=True)
class OctreeSettings:
    """How ways between surface points are tested."""

    octree_resolution: int = setting(
        128,
        "voxels",
        RESOLUTIONS[0],
        RESOLUTIONS[-1],
        "Along the longest side of the scene, a power of two; more takes longer to build and to walk, and is finer "
        "where triangles are not asked",
        source="004, 3.1 and 5: 128 and 256",
    )
    exact_reach: int = setting(
        RESOLUTIONS[-1],
        "voxels",
        0,
        RESOLUTIONS[-1],
        "So near to the ends of a way, triangles are asked in the voxels that it passes; farther off voxels block it, "
        "which darkens a little and takes less time. 0: voxels alone, as published; octree_resolution: triangles alone",
        source=OWN,
    )
