# SPDX-License-Identifier: GPL-3.0-or-later
"""Halton's points: evenly spread over the unit square whatever their number, each run of them too (Halton 1960)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .scene import Float64

BASES = (2, 3)
"""Of points in the plane."""


def radical_inverse(indices: npt.ArrayLike, base: int) -> Float64:
    """Whole numbers with their digits in `base` mirrored at the point: float64 in [0, 1), of the shape of `indices`.

    Exact but for one rounding while the digits fit 53 bits. Raises InvalidInput for a base below 2 or a negative index.
    """
    rest = np.array(indices, np.int64)
    if base < 2 or (rest < 0).any():
        raise InvalidInput(
            "radical inverse", f"base {base} or a negative index", "give a base of 2 or more, indices from 0"
        )
    # Digits are gathered as a whole number and divided once, so that no rounding adds up.
    mirrored, scale = np.zeros(rest.shape, np.int64), np.ones(rest.shape, np.int64)
    while (rest > 0).any():
        digits = rest % base
        mirrored = np.where(rest > 0, mirrored * base + digits, mirrored)
        scale = np.where(rest > 0, scale * base, scale)
        rest //= base
    return mirrored / scale


def halton_points(count: int, first: int = 1, bases: Sequence[int] = BASES) -> Float64:
    """(count, len(bases)) float64 in [0, 1): radical inverses of the indices from `first` on.

    Index 0 is the origin in every base, so sequences begin at 1.
    """
    indices = np.arange(first, first + count)
    return np.stack([radical_inverse(indices, base) for base in bases], axis=-1)
