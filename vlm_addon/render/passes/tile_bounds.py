# SPDX-License-Identifier: GPL-3.0-or-later
"""Square tiles of the picture and the bounds of what each shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..gpu_layout import POINT_GROUP
from ..link_table import TAG_DEFINES
from ..shader_library import ShaderLibrary, set_uniforms
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

# Invocations and pixels per side of a tile: each invocation shades a square of pixels, so that a light is fetched
# once for all of them.
GROUP_SIDE = 8
PIXELS_PER_SIDE = 2
TILE_SIDE = GROUP_SIDE * PIXELS_PER_SIDE
TILE_BINDING = 0
TILE_DEFINES = {
    **TAG_DEFINES,
    "GROUP_SIDE": GROUP_SIDE,
    "PIXELS_PER_SIDE": PIXELS_PER_SIDE,
    "TILE_BINDING": TILE_BINDING,
}
"""What passes/tile_pixels.glsl needs."""


@dataclass(frozen=True)
class Tiles:
    """Tiles of a picture, row by row. bounds: a POINT_GROUP for each. size: of the picture in pixels."""

    bounds: moderngl.Buffer
    size: tuple[int, int]

    @property
    def grid(self) -> tuple[int, int]:
        """Tiles across and down."""
        width, height = self.size
        return -(-width // TILE_SIDE), -(-height // TILE_SIDE)

    def uniforms(self) -> dict[str, object]:
        """What passes/tile_pixels.glsl needs of them."""
        return {"tiles_across": self.grid[0], "picture_size": self.size}

    def shown(self) -> npt.NDArray[np.uint32]:
        """Indices of the tiles that show a surface; waits for the device."""
        across, down = self.grid
        groups = np.frombuffer(self.bounds.read(across * down * POINT_GROUP.dtype.itemsize), POINT_GROUP.dtype)
        return np.flatnonzero(groups["half_extent"][:, 0] >= 0.0).astype(np.uint32)


class TileBoundsPass:
    """Bounds of the surface points of each tile."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._shader = shaders.compute("passes/tile_bounds.comp", TILE_DEFINES)
        across, down = -(-width // TILE_SIDE), -(-height // TILE_SIDE)
        bounds = context.buffer(reserve=across * down * POINT_GROUP.dtype.itemsize)
        self._tiles = Tiles(bounds, (width, height))

    def render(self, gbuffer: GBuffer) -> Tiles:
        """The next call overwrites the tiles."""
        gbuffer.bind()
        self._tiles.bounds.bind_to_storage_buffer(TILE_BINDING)
        set_uniforms(self._shader, self._tiles.uniforms())
        self._shader.run(*self._tiles.grid)
        self._context.memory_barrier()
        return self._tiles
