# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of Blender's images in linear Rec.709."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.parallel import slices
from ...core.scene import Float32, Float64
from .color_space import into_rec709, srgb_to_linear

# What Cycles shows where an image is missing.
MISSING_COLOR = (1.0, 0.0, 1.0, 1.0)
RAW_SPACES = ("Non-Color", "Raw", "Generic Data")
LINEAR_REC709_SPACES = ("Linear Rec.709", "Linear")
# Rows of a picture that stay within a cache.
ROWS_AT_ONCE = 64


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
    space = image.colorspace_settings.name
    if image.is_float:
        return _float_pixels(pixels, image, straight_alpha, np.eye(3) if space in RAW_SPACES else to_rec709)
    if space not in (*RAW_SPACES, *LINEAR_REC709_SPACES, "sRGB"):
        report(f"image {image.name!r} is in color space {space!r}", "read as sRGB")
    levels = np.linspace(0.0, 1.0, 256, dtype=np.float32)
    decode = levels if space in (*RAW_SPACES, *LINEAR_REC709_SPACES) else srgb_to_linear(levels)
    return _byte_pixels(pixels, image, straight_alpha, decode)


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


def _float_pixels(pixels: Float32, image: Any, straight: bool, to_rec709: Float64) -> Float32:
    """Blender converts float images to the working space when it loads them, and keeps their alpha premultiplied."""
    pixels[..., :3] = into_rec709(pixels[..., :3], to_rec709)
    if _has_no_alpha(image):
        pixels[..., 3] = 1.0
    elif image.alpha_mode != "CHANNEL_PACKED" and straight:
        alpha = pixels[..., 3:]
        np.divide(pixels[..., :3], alpha, out=pixels[..., :3], where=alpha > 0.0)
    return pixels


def _byte_pixels(pixels: Float32, image: Any, straight: bool, decode: Float32) -> Float32:
    """Blender keeps the alpha of byte images straight. Cycles multiplies encoded bytes, and cuts off what is left."""
    result = np.empty(pixels.shape, np.float32)
    for part in slices(len(pixels), ROWS_AT_ONCE):
        stored = (pixels[part] * np.float32(255.0) + np.float32(0.5)).astype(np.uint8)
        if _has_no_alpha(image):
            stored[..., 3] = 255
        elif image.alpha_mode != "CHANNEL_PACKED" and not straight:
            product = stored[..., :3].astype(np.uint16) * stored[..., 3:]
            stored[..., :3] = product // 255
        decode.take(stored, out=result[part], mode="clip")
        result[part, ..., 3] = stored[..., 3] / np.float32(255.0)
    return result


def _has_no_alpha(image: Any) -> bool:
    return image.alpha_mode == "NONE" or image.channels in (1, 3)
