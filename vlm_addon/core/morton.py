# SPDX-License-Identifier: GPL-3.0-or-later
"""Order along the Z-order curve (Morton 1966): what is near in it is near in space."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .scene import Float64

Int64 = npt.NDArray[np.int64]

BITS_PER_AXIS = 20


def morton_codes(points: Float64) -> Int64:
    """(n,) int64: position along the Z-order curve through the points' bounding cube; near codes are near in space."""
    if not len(points):
        return np.zeros(0, np.int64)
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), np.finfo(float).tiny)
    cells = np.minimum((points - low) / extent * (1 << BITS_PER_AXIS), (1 << BITS_PER_AXIS) - 1).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for axis in range(3):
        code |= spread_bits(cells[:, axis]) << (2 - axis)
    return code


def spread_bits(values: Int64) -> Int64:
    """Each of the lower 21 bits moved to every third place."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        values = (values | values << shift) & mask
    return values
