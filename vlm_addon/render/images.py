# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for the eye where Blender's colour management is not at hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..core.scene import Float32


def srgb_from_linear(image: Float32) -> npt.NDArray[np.uint8]:
    """(h, w, 3) uint8 of a linear Rec.709 picture (h, w, 3 or 4): clipped to [0, 1], sRGB transfer (IEC 61966-2-1)."""
    linear = np.clip(np.nan_to_num(image[..., :3].astype(np.float64)), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(255.0 * encoded).astype(np.uint8)
