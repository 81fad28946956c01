# SPDX-License-Identifier: GPL-3.0-or-later
"""Reductions over the three corners of many triangles.

NumPy reduces short axes several times as slowly as it combines whole arrays; the values are the same to the bit.
"""

from __future__ import annotations

import numpy as np

from .scene import Float64


def lowest(corners: Float64) -> Float64:
    """(n, ...) the least of each (n, 3, ...) over its three entries."""
    least: Float64 = np.minimum(np.minimum(corners[:, 0], corners[:, 1]), corners[:, 2])
    return least


def highest(corners: Float64) -> Float64:
    """(n, ...) the largest of each (n, 3, ...) over its three entries."""
    most: Float64 = np.maximum(np.maximum(corners[:, 0], corners[:, 1]), corners[:, 2])
    return most


def middles(corners: Float64) -> Float64:
    """(n, ...) the mean of each (n, 3, ...) over its three entries."""
    middle: Float64 = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0
    return middle


def squares(vectors: Float64) -> Float64:
    """(n,) squared length of (n, 3) vectors."""
    x, y, z = vectors.T
    square: Float64 = x * x + y * y + z * z
    return square
