# SPDX-License-Identifier: GPL-3.0-or-later
"""Interleaved sampling: a picture split into n x n tiles of every n-th pixel, and merged again (seed 004, 4.6, 4.11).

The pixels of a tile use the same share of the lights, so that a work group reads the same of them; the pixels of any
n x n square together use all. Between both passes stands a gather that reads a G-buffer, and after them
`GeometryFilterPass`, which takes the mean of each square's pixels:

    split = SplitPass(scene.context, scene.shaders, width, height, n)
    merge = MergePass(scene.context, scene.shaders, width, height, n)
    picked = split.render(frame.gbuffer)
    merged = merge.render(my_gather(picked.gbuffer, split.tile_size))

The tile in column i and row j, from the lower left, has the pixels whose x is i and whose y is j modulo n.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from .gbuffer import GBuffer
from .low_resolution import PickedPixels

if TYPE_CHECKING:
    import moderngl

TILE_MULTIPLE = 8
"""Pixels that a tile's sides are a multiple of, so that no work group of 8 x 8 lies in two tiles."""
SPLIT_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])


def tile_size(width: int, height: int, n: int) -> tuple[int, int]:
    """Width and height in pixels of one of the n x n tiles of a picture."""
    columns, rows = (-(-side // (n * TILE_MULTIPLE)) * TILE_MULTIPLE for side in (width, height))
    return columns, rows


class SplitPass:
    """A G-buffer as n x n tiles side by side. tile_size, size: width and height of one and of all, pixels."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int, n: int) -> None:
        """width, height: of the picture. n: from 1 on."""
        self.tile_size = tile_size(width, height, n)
        self.size = size = n * self.tile_size[0], n * self.tile_size[1]
        position, shading_normal, geometric_normal = (context.texture(size, 4, dtype="f4") for _ in range(3))
        ids, pixel = context.texture(size, 4, dtype="i4"), context.texture(size, 2, dtype="i4")
        # A gather reads neither base colour nor emission, but something has to be bound there.
        gbuffer = GBuffer(position, shading_normal, geometric_normal, position, position, ids)
        self._picked = PickedPixels(gbuffer, pixel)
        self._framebuffer = context.framebuffer([position, shading_normal, geometric_normal, ids, pixel])
        self._split = FullscreenPass(context, shaders, "passes/interleave_split.frag", {"INTERLEAVE": n})

    def render(self, gbuffer: GBuffer) -> PickedPixels:
        """`gbuffer`, of the picture's size, split; texels beyond the picture show no surface.

        Its base colour and emission are not those of the picture. The next call overwrites the textures.
        """
        gbuffer.bind()
        set_uniforms(self._split.program, {"tile_size": self.tile_size})
        self._split.draw(self._framebuffer)
        return self._picked


class MergePass:
    """What was found for a split picture, in the order of the picture's pixels."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int, n: int) -> None:
        """As of the SplitPass."""
        self._tile_size = tile_size(width, height, n)
        self._merged = context.texture((width, height), 4, dtype="f4")
        self._framebuffer = context.framebuffer([self._merged])
        defines = {"INTERLEAVE": n, "SPLIT_UNIT": SPLIT_UNIT}
        self._merge = FullscreenPass(context, shaders, "passes/interleave_merge.frag", defines)

    def render(self, split: moderngl.Texture) -> moderngl.Texture:
        """RGBA32F of the picture's size: each texel of `split`, RGBA32F of the split G-buffer's size, at its pixel.

        Values are moved, not computed with. The next call overwrites the texture.
        """
        split.use(SPLIT_UNIT)
        set_uniforms(self._merge.program, {"tile_size": self._tile_size})
        self._merge.draw(self._framebuffer)
        return self._merged
