# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a cube of voxels lies in a scene. In voxel coordinates voxel i fills the interval from i to i + 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import InvalidInput
from .grid_frame import Bounds, finite_bounds
from .scene import Float64

RESOLUTIONS = (8, 16, 32, 64, 128, 256, 512, 1024)
"""Voxels along each axis: three of them have 10 bits each in one word (seed 004, 3.1)."""

_MARGIN = 0.5


@dataclass(frozen=True)
class VoxelFrame:
    """A cube of 2^depth voxels along each axis. low: (3,) float64, its lower corner; voxel_size: both in the unit of
    the scene."""

    low: Float64
    voxel_size: float
    depth: int

    @property
    def resolution(self) -> int:
        """Voxels along each axis."""
        return 1 << self.depth

    def voxels(self, points: Float64) -> Float64:
        """(..., 3) points of the scene in voxel coordinates."""
        return np.asarray((points - self.low) / self.voxel_size)

    def points(self, places: Float64) -> Float64:
        """(..., 3) voxel coordinates as points of the scene."""
        return np.asarray(places * self.voxel_size + self.low)


def make_voxel_frame(bounds: Bounds, resolution: int) -> VoxelFrame:
    """The cube of `resolution` voxels along each axis over `bounds`, lower and upper corner.

    The bounds begin in the middle of the first voxels and end in the middle of the last ones of the longest axis:
    walls that lie on the bounds of a room then fill one layer of voxels, not the two on both sides of a face.
    Raises InvalidInput for another resolution than those of RESOLUTIONS and for bounds that are not finite or empty.
    """
    if resolution not in RESOLUTIONS:
        known = ", ".join(str(known) for known in RESOLUTIONS)
        raise InvalidInput("voxel resolution", f"{resolution} voxels along an axis", f"choose one of {known}")
    low, high = finite_bounds(bounds)
    extent = float((high - low).max())
    voxel_size = extent / (resolution - 2.0 * _MARGIN) if extent > 0.0 else 1.0
    return VoxelFrame(low - _MARGIN * voxel_size, voxel_size, resolution.bit_length() - 1)
