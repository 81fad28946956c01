# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of Blender's images in linear Rec.709."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.scene import Float32, Float64
from .color_space import convert, srgb_to_linear

# What Cycles shows where an image is missing.
MISSING_COLOR = (1.0, 0.0, 1.0, 1.0)
RAW_SPACES = ("Non-Color", "Raw", "Generic Data")
LINEAR_REC709_SPACES = ("Linear Rec.709", "Linear")


def image_pixels(
    image: Any, to_rec709: Float64, straight_alpha: bool, report: Callable[[str, str], None]
) -> Float32 | None:
    """(h, w, 4) float32 of an image, row 0 at the bottom; None where it cannot be read.

    Colour images become linear Rec.709, data images stay raw. straight_alpha: as Cycles decides it, colour is divided
    by alpha only where the alpha output is used too; otherwise it is multiplied. report(problem, remedy) takes what
    is approximated.
    """
    width, height = image.size
    if not width or not height or not image.channels:
        report(f"image {image.name!r} is missing ({image.filepath or 'no file'})", "find or pack it; shown in magenta")
        return None
    if image.source in ("SEQUENCE", "MOVIE"):
        report(f"image {image.name!r} is a {image.source.lower()}", "its current picture is used for all frames")
    if image.source == "TILED":
        report(f"image {image.name!r} has UDIM tiles", "its first tile is used for all")
    stored = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(stored)
    pixels = _four_channels(stored.reshape(height, width, image.channels))
    pixels = _with_alpha(pixels, image, straight_alpha)
    space = image.colorspace_settings.name
    if space not in RAW_SPACES:
        pixels[..., :3] = _linear(pixels[..., :3], image, space, to_rec709, report)
    return pixels


def _four_channels(stored: Float32) -> Float32:
    height, width, channels = stored.shape
    if channels == 4:
        return stored
    pixels = np.ones((height, width, 4), np.float32)
    if channels == 3:
        pixels[..., :3] = stored
    else:
        pixels[..., :3] = stored[..., :1]
    if channels == 2:
        pixels[..., 3] = stored[..., 1]
    return pixels


def _linear(
    colors: Float32, image: Any, space: str, to_rec709: Float64, report: Callable[[str, str], None]
) -> np.ndarray:
    if image.is_float:
        # Blender converts float images to the working space when it loads them.
        return convert(colors, to_rec709)
    if space in LINEAR_REC709_SPACES:
        return colors
    if space != "sRGB":
        report(f"image {image.name!r} is in colour space {space!r}", "read as sRGB")
    return srgb_to_linear(colors)


def _with_alpha(pixels: Float32, image: Any, straight: bool) -> Float32:
    mode = image.alpha_mode
    if mode == "NONE" or image.channels in (1, 3):
        pixels[..., 3] = 1.0
        return pixels
    if mode == "CHANNEL_PACKED":
        return pixels
    # `pixels` of a byte image hold straight alpha, those of a float image premultiplied alpha. Cycles multiplies the
    # encoded values of byte images.
    if image.is_float and straight:
        alpha = pixels[..., 3:]
        np.divide(pixels[..., :3], alpha, out=pixels[..., :3], where=alpha > 0.0)
    if not image.is_float and not straight:
        pixels[..., :3] *= pixels[..., 3:]
    return pixels
