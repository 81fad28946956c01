# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain sRGB transfer."""

from __future__ import annotations

import numpy as np
import pytest

from vlm_addon.render.images import srgb_from_linear


@pytest.mark.parametrize(
    ("linear", "byte"),
    [(-1.0, 0), (0.0, 0), (0.0031308, 10), (0.18, 118), (0.5, 188), (1.0, 255), (7.0, 255), (np.inf, 255), (np.nan, 0)],
)
def test_values_of_the_standard(linear: float, byte: int) -> None:
    assert (srgb_from_linear(np.full((2, 3, 4), linear, np.float32)) == byte).all()


def test_every_byte_comes_back() -> None:
    """The inverse transfer of IEC 61966-2-1, written out."""
    encoded = np.arange(256) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)
    image = np.repeat(linear[None, :, None], 3, axis=2)
    assert srgb_from_linear(image)[0, :, 1].tolist() == list(range(256))
