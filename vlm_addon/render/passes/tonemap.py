# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of any range of luminances for a display, by a local operator (seed 004, 4.12: "a simple local" one).

The logarithm of each luminance is split in two (Durand and Dorsey 2002): a base, smooth but for the edges of the
picture, by a guided filter (He, Sun and Tang 2010), and the rest, detail. The base's contrast is reduced where it is
large, detail stays, and the photographic curve (Reinhard et al. 2002, eq. 4) takes the sum to [0, 1]. So a room and
the sunlit yard before its window both keep their textures.

Exposure follows the picture: its mean logarithm becomes KEY. A picture that is a thousand times as bright looks the
same. In an even region display luminance rises with luminance; an even picture is the curve at KEY. Black stays black,
what is not finite becomes black and counts for nothing, nor does what is black.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import Float64
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms

if TYPE_CHECKING:
    import moderngl

KEY = 0.18
"""Of the display's luminance, before the curve, that the picture's mean becomes (Reinhard et al. 2002: middle grey)."""
WHITE = 2.0
"""Luminance before the curve that becomes 1."""
MOST_SPREAD = 1.25
"""Stops, standard deviation of the base; larger ones are brought down to it."""
EDGE_VARIANCE = 0.25
"""Stops², of what is half an edge and half detail. Halos beside an edge are below 0.12 stops; with 0.5 below 0.2."""
RADIUS_SHARE = 1.0 / 16.0
"""Of the picture's longer side: how far from a pixel its base looks, twice."""
REACH = 16.0
"""Stops from the mean at which the base's input is cut: a single pixel cannot move what is far from it."""
UNCUT = 1e3
SMALLEST, LARGEST = 1e-36, 1e36
"""Of luminances that count."""
GROUP_SIDE, GROUP_SIZE = 8, 64
SUM_BINDING = 0
FIRST_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
DEFINES = {
    "GROUP_SIDE": GROUP_SIDE,
    "GROUP_SIZE": GROUP_SIZE,
    "SUM_BINDING": SUM_BINDING,
    "PICTURE_UNIT": FIRST_UNIT,
    "LOG_UNIT": FIRST_UNIT,
    "MOMENT_UNIT": FIRST_UNIT + 1,
    "FIT_UNIT": FIRST_UNIT + 1,
    "BASE_UNIT": FIRST_UNIT + 1,
    "KEY": KEY,
    "WHITE": WHITE,
    "EDGE_VARIANCE": EDGE_VARIANCE,
    "SMALLEST": SMALLEST,
    "LARGEST": LARGEST,
}


@dataclass(frozen=True)
class _Moments:
    """Mean and standard deviation of a picture's logarithms, stops."""

    mean: float
    deviation: float


class ToneMapPass:
    """Pictures of one size for a display."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._size = width, height
        self._radius = max(round(RADIUS_SHARE * max(width, height)), 1)
        self._logs, self._across, self._sums, self._line, self._result = (
            context.texture(self._size, 4, dtype="f4") for _ in range(5)
        )
        self._rows = context.buffer(reserve=16 * height)
        self._log, self._fit, self._base, self._display, self._sum = (
            shaders.compute(f"passes/tonemap_{name}.comp", DEFINES) for name in ("log", "fit", "base", "display", "sum")
        )
        self._box = {
            is_vertical: shaders.compute("passes/tonemap_box.comp", {**DEFINES, "IS_VERTICAL": is_vertical})
            for is_vertical in (False, True)
        }

    def render(self, picture: moderngl.Texture) -> moderngl.Texture:
        """RGBA32F, display-linear Rec.709 in [0, 1]: encode as sRGB to store 8 bits.

        picture: RGBA32F of the pass's size, linear Rec.709 of any scale. Alpha stays as it is. The next call overwrites
        the texture.
        """
        self._run(self._log, [picture], self._logs, middle=0.0, reach=UNCUT)
        middle = self._moments(self._logs).mean
        self._run(self._log, [picture], self._logs, middle=middle, reach=REACH)
        self._boxed(self._logs)
        self._run(self._fit, [self._logs, self._sums], self._line)
        self._boxed(self._line)
        self._run(self._base, [self._logs, self._sums], self._line)
        contrast = MOST_SPREAD / max(self._moments(self._line).deviation, MOST_SPREAD)
        self._run(self._display, [picture, self._line], self._result, middle=middle, contrast=contrast)
        return self._result

    def _boxed(self, image: moderngl.Texture) -> None:
        """Leaves in `_sums` the sums of `image` over squares."""
        width, height = self._size
        for is_vertical, source, target in ((False, image, self._across), (True, self._across, self._sums)):
            shader, lines = self._box[is_vertical], width if is_vertical else height
            source.use(FIRST_UNIT)
            target.bind_to_image(0, read=False, write=True)
            set_uniforms(shader, {"radius": self._radius})
            shader.run(-(-lines // GROUP_SIZE))
            self._context.memory_barrier()

    def _run(
        self, shader: moderngl.ComputeShader, sources: list[moderngl.Texture], target: moderngl.Texture, **values: float
    ) -> None:
        """Runs a shader for each pixel of `target`."""
        for unit, source in enumerate(sources, FIRST_UNIT):
            source.use(unit)
        target.bind_to_image(0, read=False, write=True)
        set_uniforms(shader, values)
        shader.run(*(-(-side // GROUP_SIDE) for side in self._size))
        self._context.memory_barrier()

    def _moments(self, image: moderngl.Texture) -> _Moments:
        """Of what `image` holds as weight, value and square; 0 where nothing counts."""
        image.use(FIRST_UNIT)
        self._rows.bind_to_storage_buffer(SUM_BINDING)
        self._sum.run(-(-self._size[1] // GROUP_SIZE))
        self._context.memory_barrier()
        rows: Float64 = np.frombuffer(self._rows.read(), np.float32).reshape(-1, 4).astype(float)
        count, total, squares, _ = rows.sum(axis=0)
        if count == 0.0:
            return _Moments(0.0, 0.0)
        mean = total / count
        return _Moments(float(mean), float(np.sqrt(max(squares / count - mean * mean, 0.0))))
