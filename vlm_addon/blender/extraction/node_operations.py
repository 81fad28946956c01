# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's per-texel node operations on arrays of RGBA (..., 4) or of scalars (...), as its shading nodes define them.

Blender Manual, Shader Nodes: Color (Mix, Gamma, Invert, Brightness/Contrast, Hue/Saturation/Value) and Converter
(Math, Map Range, Clamp).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ...core.scene import Float32

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def _divide(a: Float32, b: Float32) -> Float32:
    return np.divide(a, b, out=np.zeros(np.broadcast_shapes(a.shape, b.shape), np.float32), where=b != 0.0)


def _power(a: Float32, b: Float32) -> Float32:
    with np.errstate(invalid="ignore", over="ignore"):
        return np.nan_to_num(np.power(a, b), nan=0.0).astype(np.float32)


def _overlay(a: Float32, b: Float32) -> Float32:
    return np.where(a < 0.5, 2.0 * a * b, 1.0 - 2.0 * (1.0 - a) * (1.0 - b))


BLENDS: Mapping[str, Callable[[Float32, Float32], Float32]] = {
    "MIX": lambda a, b: b,
    "MULTIPLY": lambda a, b: a * b,
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "DIVIDE": lambda a, b: np.where(b != 0.0, _divide(a, b), a),
    "DIFFERENCE": lambda a, b: np.abs(a - b),
    "DARKEN": np.minimum,
    "LIGHTEN": np.maximum,
    "SCREEN": lambda a, b: 1.0 - (1.0 - a) * (1.0 - b),
    "OVERLAY": _overlay,
}
"""Blend types of the Mix node at a factor of 1; other factors mix the result with the first colour."""

MATHS: Mapping[str, Callable[[Float32, Float32, Float32], Float32]] = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: _divide(a, b),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, c: _power(a, b),
    "SQRT": lambda a, b, c: np.sqrt(np.maximum(a, 0.0)),
    "ABSOLUTE": lambda a, b, c: np.abs(a),
    "MINIMUM": lambda a, b, c: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c: np.maximum(a, b),
    "LESS_THAN": lambda a, b, c: (a < b).astype(np.float32),
    "GREATER_THAN": lambda a, b, c: (a > b).astype(np.float32),
}
"""Operations of the Math node on its three values."""


def mix(a: Float32, b: Float32, factor: Float32, blend_type: str) -> Float32:
    """The Mix node: (..., 4) of two colours and a factor (..., 1) already clamped."""
    return (a + (BLENDS[blend_type](a, b) - a) * factor).astype(np.float32)


def gamma(color: Float32, exponent: Float32) -> Float32:
    """The Gamma node: colours of at least 0 to the power of `exponent` (..., 1)."""
    return np.where(color > 0.0, _power(np.maximum(color, 0.0), exponent), color).astype(np.float32)


def invert(color: Float32, factor: Float32) -> Float32:
    """The Invert node."""
    return (color + (1.0 - 2.0 * color) * factor).astype(np.float32)


def brightness_contrast(color: Float32, bright: Float32, contrast: Float32) -> Float32:
    """The Brightness/Contrast node; never below 0."""
    return np.maximum((1.0 + contrast) * color + bright - 0.5 * contrast, 0.0).astype(np.float32)


def luminance(color: Float32) -> Float32:
    """(..., 1) grey value of (..., 4) colours, as a colour plugged into a number is read."""
    return (color[..., :3] @ LUMINANCE)[..., None]


def hue_saturation(color: Float32, hue: Float32, saturation: Float32, value: Float32, factor: Float32) -> Float32:
    """The Hue/Saturation/Value node; hue of 0.5 leaves hues as they are."""
    rgb = np.maximum(color[..., :3], 0.0)
    high, low = rgb.max(axis=-1), rgb.min(axis=-1)
    chroma = high - low
    safe = np.where(chroma > 0.0, chroma, 1.0)
    red, green, blue = np.moveaxis(rgb, -1, 0)
    sector = np.where(high == red, (green - blue) / safe, np.where(high == green, 2 + (blue - red) / safe, 4.0))
    sector = np.where((high != red) & (high != green), 4 + (red - green) / safe, sector)
    turned = np.mod(sector / 6.0 + hue[..., 0] + 0.5, 1.0)
    new_saturation = np.clip(_divide(chroma, high) * saturation[..., 0], 0.0, 1.0)
    new_value = high * value[..., 0]
    # HSV to RGB: each channel falls from the value by the chroma where its hue distance is large.
    offsets = np.array([5.0, 3.0, 1.0], np.float32)
    k = np.mod(offsets + turned[..., None] * 6.0, 6.0)
    fall = np.clip(np.minimum(k, 4.0 - k), 0.0, 1.0)
    result = np.empty((*turned.shape, 4), np.float32)
    result[..., :3] = new_value[..., None] * (1.0 - new_saturation[..., None] * fall)
    result[..., 3] = color[..., 3]
    return (color + (result - color) * factor).astype(np.float32)


def map_range(value: Float32, from_min: Float32, from_max: Float32, to_min: Float32, to_max: Float32) -> Float32:
    """The Map Range node, linear and unclamped; 0 where the range it maps from is empty."""
    return (to_min + _divide(value - from_min, from_max - from_min) * (to_max - to_min)).astype(np.float32)
