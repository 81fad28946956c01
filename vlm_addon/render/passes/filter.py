# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes the pattern of interleaved sampling out of a picture, not over edges (seed 004, 4.12; Laine et al. 2007).

For anything that n x n pixels found with a share of the samples each: irradiance, or a ratio of two. Pixels that are
the same modulo n in both directions are of one class. The result is the mean over the classes of what each has within
n / 2 pixels: where the surface is even, each pixel once, and those at n / 2 for an even n half. So what depends on the
class alone becomes the same everywhere, to the last bit. Other surfaces do not count, as the position and the normal
tell, for both pixels alike.

At edges that leaves two errors. A class that has nothing within n / 2 pixels is looked for within n: without it the
other classes' lights would count for more. And the pixels that count lie on one side, so their mean is that of a place
inside; it is moved back along the slope, as far as that is certain. Pixels of one class used the same lights, so
differences between them show the slope without the pattern.

Values that are not numbers, infinite or beyond LARGEST are left out, so none spreads; their pixels get what their
neighbours have, as any other pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.settings import setting
from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
COUNT_BINDING = 0
VALUE_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
LARGEST = 1e17
"""Of usable values: the squares of as many as the widest kernel has can be added in float32."""
GEOMETRY, NONE = "geometry", "none"
WITH_FILTER = ("filter", GEOMETRY)


@dataclass(frozen=True)
class FilterSettings:
    """What the filter after interleaved sampling takes for one surface."""

    filter: str = setting(
        GEOMETRY,
        "",
        None,
        None,
        "What takes the pattern of interleaved sampling out of the picture: means over pixels of one surface, or "
        "nothing",
        source="004, 4.12",
        choices=(GEOMETRY, NONE),
    )
    filter_distance: float = setting(
        0.005,
        "picture widths",
        0.0,
        1e6,
        "Distance from a pixel's tangent plane up to which neighbors count for it, of what the picture shows across "
        "at its depth",
        source="004, 4.12: geometric threshold",
        only_with=WITH_FILTER,
    )
    filter_cosine: float = setting(
        0.9,
        "cosine",
        -1.0,
        1.0,
        "Of the angle between normals, from which on neighbors count",
        source="004, 4.12: geometric threshold",
        only_with=WITH_FILTER,
    )


class GeometryFilterPass:
    """Means over n x n pixels of one surface."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int, n: int) -> None:
        """width, height: of the picture. n: of the interleaving, from 1 on."""
        self._context = context
        self._result = context.texture((width, height), 4, dtype="f4")
        self._count = context.buffer(bytes(4))
        self._groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)
        defines: dict[str, int | float] = {"GROUP_SIDE": GROUP_SIDE, "COUNT_BINDING": COUNT_BINDING}
        defines |= {"VALUE_UNIT": VALUE_UNIT, "INTERLEAVE": n, "LARGEST": LARGEST}
        self._filter = shaders.compute("passes/filter.comp", defines)

    def render(
        self, gbuffer: GBuffer, texture: moderngl.Texture, view: View, settings: FilterSettings
    ) -> moderngl.Texture:
        """The mean for each pixel, RGBA32F, 0 where no surface shows or nothing usable is near; `texture` itself where
        the filter is off.

        gbuffer, texture: of the picture's size, RGBA32F; each channel is filtered, alpha has no say in how. view: that
        the G-buffer was drawn through. The next call overwrites the texture returned.
        """
        if settings.filter == NONE:
            return texture
        gbuffer.bind()
        texture.use(VALUE_UNIT)
        self._result.bind_to_image(0, read=False, write=True)
        self._count.bind_to_storage_buffer(COUNT_BINDING)
        at_0, per_depth = view.picture_width(texture.width)
        uniforms = {"least_cosine": settings.filter_cosine, "position_threshold": settings.filter_distance}
        set_uniforms(self._filter, {**uniforms, "width_at_0": at_0, "width_per_depth": per_depth})
        self._filter.run(*self._groups)
        self._context.memory_barrier()
        return self._result

    def counters(self) -> dict[str, float]:
        """Pixels so far that show a surface and whose value was not usable."""
        return {"unusable_pixels": float(np.frombuffer(self._count.read(), np.uint32)[0])}
