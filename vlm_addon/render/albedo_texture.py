# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of interface albedos as a texture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.brdf import albedo_table
from .gpu_layout import CONSTANTS

if TYPE_CHECKING:
    import moderngl


class AlbedoTexture:
    """core.brdf.albedo_table on the GPU, filtered linearly: x roughness, y and z as `lib/brdf.glsl` reads them."""

    def __init__(self, context: moderngl.Context) -> None:
        import moderngl

        table = albedo_table()
        depth, height, width, channels = table.shape
        self._texture = context.texture3d((width, height, depth), channels, table.tobytes(), dtype="f4")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = self._texture.repeat_z = False

    def bind(self) -> None:
        """Binds the table to ALBEDO_TABLE_UNIT."""
        self._texture.use(int(CONSTANTS["ALBEDO_TABLE_UNIT"]))
