# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that stand for values in the viewport: as screens take them, sRGB in [0, 1]."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .scene import Float64, Int32

KNEE = 0.8
"""Linear brightness up to which an HDR colour is shown as it is; all above shares the rest."""
_GOLDEN_RATIO = 0.6180339887498949
# Saturation and brightness of tags: neighbouring ids differ in hue most, and in these, too.
_SATURATIONS, _VALUES = (0.85, 0.55, 0.7), (1.0, 0.75)
_HEAT = np.array([[0.0, 0.0, 0.35, 1.0], [0.5, 0.1, 0.75, 0.25], [0.75, 0.95, 0.85, 0.1], [1.0, 0.9, 0.1, 0.05]])
"""Steps of a scale: place in [0, 1], red, green, blue."""


def srgb(linear: npt.ArrayLike) -> Float64:
    """Linear Rec.709 in [0, 1], any shape, as screens take it (IEC 61966-2-1)."""
    values = np.clip(np.asarray(linear, np.float64), 0.0, 1.0)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1.0 / 2.4) - 0.055)


def hdr_colors(linear: npt.ArrayLike) -> Float64:
    """(n, 3): linear Rec.709 of any size and its hue kept: as it is up to KNEE, then ever slower towards 1.

    Of two colours of one hue the larger is shown brighter, however large both are.
    """
    colors = np.maximum(np.asarray(linear, np.float64), 0.0)
    brightest = colors.max(axis=-1, keepdims=True)
    over = np.maximum(brightest - KNEE, 0.0)
    shown = np.minimum(brightest, KNEE) + (1.0 - KNEE) * over / (over + 1.0)
    return srgb(colors * np.divide(shown, brightest, out=np.ones_like(shown), where=brightest > 0.0))


def tag_colors(tags: Int32) -> Float64:
    """(n, 3): one colour for each tag id, always the same; hues of neighbouring ids are far apart."""
    ids = np.asarray(tags, np.int64)
    hue = (ids * _GOLDEN_RATIO) % 1.0
    saturation = np.array(_SATURATIONS)[ids % len(_SATURATIONS)]
    value = np.array(_VALUES)[ids // len(_SATURATIONS) % len(_VALUES)]
    return _from_hsv(hue, saturation, value)


def heat_colors(shares: npt.ArrayLike) -> Float64:
    """(n, 3): blue for 0, green for a half, yellow, red for 1 and more."""
    values = np.clip(np.asarray(shares, np.float64), 0.0, 1.0)
    return np.stack([np.interp(values, _HEAT[:, 0], channel) for channel in _HEAT[:, 1:].T], axis=-1)


def _from_hsv(hue: npt.NDArray[Any], saturation: npt.NDArray[Any], value: npt.NDArray[Any]) -> Float64:
    """(n, 3) by the usual formula: each channel falls as the hue is farther than a sixth from its own."""
    away = np.abs((hue[:, None] * 6.0 + np.array([0.0, 4.0, 2.0])) % 6.0 - 3.0) - 1.0
    return np.asarray(value[:, None] * (1.0 - saturation[:, None] * (1.0 - np.clip(away, 0.0, 1.0))))
