# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for the eye where Blender's colour management is not at hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..core.scene import Float32, Float64


def srgb_encoded(linear: npt.ArrayLike) -> Float64:
    """float64 in [0, 1] of linear values: clipped to [0, 1], sRGB transfer (IEC 61966-2-1); 0 for NaN."""
    clipped = np.clip(np.nan_to_num(np.asarray(linear, np.float64)), 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * np.maximum(clipped, 1e-9) ** (1 / 2.4) - 0.055)


def srgb_from_linear(image: Float32) -> npt.NDArray[np.uint8]:
    """(h, w, 3) uint8 of a linear Rec.709 picture (h, w, 3 or 4)."""
    return np.round(255.0 * srgb_encoded(image[..., :3])).astype(np.uint8)
