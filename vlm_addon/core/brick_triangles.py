# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles behind the voxels of an octree: which meet each brick, and where ways between points meet them.

What follows is in voxel coordinates from 0 to 2^depth, in float32 on the device: corners are multiples of
`lattice_step`, which is also the most by which one rounding of such a coordinate is off. Everything here that is small
is a number of those steps, so none depends on the scene.
"""

from __future__ import annotations

LATTICE_SHARE = 2.0**-24
"""Of the side of all voxels: `lattice_step`."""
EDGE_SHARE = 8.0 * LATTICE_SHARE
"""Of the side of all voxels: how far outside its edges a way still meets a triangle. Two triangles see their shared
edge from the same two corners; across the way, each of those is off by some 2 steps for the differences and 2 for the
shear, the same in both, and the side of the edge on which the way lies by less than 4 in each."""
LIFT_SHARE = 64.0 * LATTICE_SHARE
"""Of the side of all voxels: how far over their own planes ways begin and end. Corners are off by a step, a position in
a G-buffer or of a light by some 4, its voxel coordinates by 3, its height over a plane by 4, and EDGE_SHARE is 8."""

ALL_EXACT = 1 << 20
"""Voxels from both ends of a way within which triangles are asked, where all are."""


def lattice_step(depth: int) -> float:
    """Coordinates from 0 to 2^depth are multiples of this on the device: differences of two are exact in float32."""
    return LATTICE_SHARE * float(1 << depth)
