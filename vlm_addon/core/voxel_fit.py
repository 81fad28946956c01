# SPDX-License-Identifier: GPL-3.0-or-later
"""How fine voxels have to be for rays to ask few triangles in each: a dense mesh in a wide scene may lie in one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .grid_frame import Bounds
from .scene import Float64, Mesh
from .voxel_frame import RESOLUTIONS, make_voxel_frame

MOST_IN_A_VOXEL = 512
"""Triangles whose middle is in the same voxel. Software renderers end a shader's loops after 65,535 rounds, and on any
device rays that ask many times as many take many times as long."""


def fitting_resolution(meshes: Sequence[Mesh], bounds: Bounds, resolution: int) -> int:
    """The least of RESOLUTIONS, from `resolution` on, with at most MOST_IN_A_VOXEL triangles in a voxel; the greatest
    if there is none. bounds: of the cube of voxels, as make_voxel_frame takes them.

    Raises InvalidInput as make_voxel_frame.
    """
    middles = [mesh.positions[mesh.triangles].mean(axis=1) for mesh in meshes if len(mesh.triangles)]
    make_voxel_frame(bounds, resolution)
    if not middles:
        return resolution
    places = np.concatenate(middles)
    for finer in RESOLUTIONS[RESOLUTIONS.index(resolution) :]:
        if most_in_a_voxel(make_voxel_frame(bounds, finer).voxels(places)) <= MOST_IN_A_VOXEL:
            return finer
    return RESOLUTIONS[-1]


def most_in_a_voxel(places: Float64) -> int:
    """Of (n, 3) points in voxel coordinates, n from 1, how many are in the same voxel at most."""
    _, counts = np.unique(np.floor(places).astype(np.int64), axis=0, return_counts=True)
    return int(counts.max())
