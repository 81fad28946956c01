# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that are evenly spread over pixels near each other and over the samples of each pixel.

A filter over 4 x 4 pixels wants them all to differ: noise that is independent from pixel to pixel falls with the root
of the pixels, that of evenly spread numbers nearly with their count.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .scene import Float64

SIDE = 4
"""Pixels along each side of what holds every number once."""

_RATIOS = (2654435769, 1779033703)
"""Of 2^32: the golden ratio's and the root of 2's part behind the point, whose multiples leave the smallest gaps."""


def bayer_rank(pixels: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """(n,) 0 to 15: which of 16 each pixel (n, 2) is; those of any 4 x 4 differ, those of any 2 x 2 are spread
    (Bayer 1973)."""
    x, y = pixels.T.astype(np.uint32)
    differ = x ^ y
    return np.asarray((differ & 1) << 3 | (y & 1) << 2 | (differ >> 1 & 1) << 1 | (y >> 1 & 1))


def spread_pattern(pixels: npt.NDArray[np.uint32], index: int, sample_index: int) -> Float64:
    """(n, 2) in [0, 1) of pixels (n, 2): the first the same for each index, each sixteenth once in any 4 x 4 pixels;
    the second the radical inverse of 16 index + rank."""
    rank = bayer_rank(pixels).astype(np.int64)
    across = rank << 28
    along = np.zeros_like(rank)
    for bit in range(32):
        along = along | ((rank + 16 * index) >> bit & 1) << (31 - bit)
    moved = [(value + sample_index * ratio) % 2**32 >> 8 for value, ratio in zip((across, along), _RATIOS, strict=True)]
    return np.stack(moved, axis=1).astype(np.float64) / 2**24
