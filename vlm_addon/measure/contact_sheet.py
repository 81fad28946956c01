# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures side by side with labels, for people to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from PIL.Image import Image

LABEL_HEIGHT_PX = 26
GAP_PX = 6
BACKGROUND = (24, 24, 24)
TEXT = (235, 235, 235)

ERROR_DECADES = (1e-3, 1e-2, 1e-1, 1.0)
"""Bounds of the bands of an error map: one hue a decade."""
DECADE_HUES = ((40, 60, 160), (30, 160, 150), (230, 190, 50), (210, 60, 50))


def side_by_side(pictures: Sequence[tuple[str, Image]], columns: int | None = None) -> Image:
    """One 8-bit RGB picture: each given picture under its label, in rows of `columns` (all in one row without)."""
    from PIL import Image, ImageDraw, ImageFont

    columns = columns or len(pictures)
    rows = -(-len(pictures) // columns)
    width, height = pictures[0][1].size
    cell_width, cell_height = width + GAP_PX, height + LABEL_HEIGHT_PX + GAP_PX
    sheet = Image.new("RGB", (columns * cell_width + GAP_PX, rows * cell_height + GAP_PX), BACKGROUND)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=15)
    for index, (label, picture) in enumerate(pictures):
        x, y = GAP_PX + index % columns * cell_width, GAP_PX + index // columns * cell_height
        draw.text((x + 2, y + 3), label, fill=TEXT, font=font)
        sheet.paste(picture, (x, y + LABEL_HEIGHT_PX))
    return sheet


def error_map(error: npt.NDArray[np.floating]) -> Image:
    """8-bit RGB picture of an (h, w) relative error: one hue a decade, brighter within it as the error grows.

    Below the first of ERROR_DECADES black, above the last white.
    """
    from PIL import Image

    shown = np.zeros((*error.shape, 3))
    for low, hue in zip(ERROR_DECADES, DECADE_HUES, strict=True):
        within = np.clip(np.log10(np.maximum(error, 1e-12) / low), 0.0, 1.0)[..., None]
        shown = np.where(error[..., None] >= low, (0.35 + 0.65 * within) * np.array(hue), shown)
    shown = np.where(error[..., None] >= 10 * ERROR_DECADES[-1], 255.0, shown)
    return Image.fromarray(shown.astype(np.uint8))
