# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of fitted lobes as a texture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.ltc import ltc_table

if TYPE_CHECKING:
    import moderngl


class LtcTexture:
    """core.ltc.ltc_table on the GPU, filtered linearly: x the view's coordinate, y roughness."""

    def __init__(self, context: moderngl.Context) -> None:
        import moderngl

        table = ltc_table()
        height, width, channels = table.shape
        self._texture = context.texture((width, height), channels, table.tobytes(), dtype="f4")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = False

    def bind(self, unit: int) -> None:
        """Binds the table to a texture unit."""
        self._texture.use(unit)
