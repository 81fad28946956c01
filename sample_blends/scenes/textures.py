# SPDX-License-Identifier: GPL-3.0-or-later
"""Grain for images and chance for layouts, from integer arithmetic only, so that every machine makes the same."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def lattice(x: npt.NDArray[np.int64], y: npt.NDArray[np.int64], seed: int) -> npt.NDArray[np.int64]:
    """A value from 0 to 255 for each pair of integers, without visible order."""
    mixed = (x * 374761393 + y * 668265263 + seed * 974634541) & 0xFFFFFFFF
    mixed = ((mixed ^ (mixed >> 13)) * 1274126177) & 0xFFFFFFFF
    return (mixed ^ (mixed >> 16)) & 0xFF
