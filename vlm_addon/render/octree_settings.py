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
        2,
        "voxels",
        0,
        RESOLUTIONS[-1],
        "Near the ends of a way, triangles are asked, so that what stands close by casts its shadow; farther from both "
        "ends than this, voxels do: 0 asks none, the resolution asks them everywhere, which is slower",
        source=OWN,
    )
