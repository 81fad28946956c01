# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's working space (Rec.709, Rec.2020 or ACEScg since 5.0) to linear Rec.709 and back."""

from __future__ import annotations

import numpy as np
from mathutils import Color

from ...core.scene import Float64

# Blender converts in float32: a matrix this close to the identity is the identity.
IDENTITY_TOLERANCE = 1e-5


def working_to_rec709() -> Float64:
    """(3, 3) float64 matrix M: linear Rec.709 = M @ colour in the file's working space."""
    columns = [Color(axis).from_scene_linear_to_rec709_linear() for axis in np.eye(3).tolist()]
    matrix = np.array(columns, np.float64).T
    return np.eye(3) if np.allclose(matrix, np.eye(3), atol=IDENTITY_TOLERANCE) else matrix


def rec709_to_working() -> Float64:
    """(3, 3) float64: the inverse of `working_to_rec709`."""
    return np.linalg.inv(working_to_rec709())


def convert(colors: np.ndarray, matrix: Float64) -> np.ndarray:
    """(..., 3) colours times a (3, 3) matrix, in the dtype given; the same array where the matrix is the identity."""
    if np.array_equal(matrix, np.eye(3)):
        return colors
    return (colors @ matrix.T).astype(colors.dtype)


def into_rec709(colors: np.ndarray, matrix: Float64) -> np.ndarray:
    """`convert`, where a colour without a negative channel has none afterwards: what Rec.709 lacks is cut at 0."""
    converted = convert(colors, matrix)
    if converted is colors:
        return colors
    sound = (colors >= 0.0).all(axis=-1, keepdims=True)
    return np.where(sound, np.maximum(converted, 0.0), converted).astype(colors.dtype)


def srgb_to_linear(encoded: np.ndarray) -> np.ndarray:
    """Values of IEC 61966-2-1 (sRGB) decoded to linear light, in the dtype given."""
    low = encoded / 12.92
    high = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, low, high).astype(encoded.dtype)
