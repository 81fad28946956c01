# SPDX-License-Identifier: GPL-3.0-or-later
"""How near and how far the surfaces are that show."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..gpu_layout import CONSTANTS
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
_NOTHING = np.array([math.inf, 0.0], np.float32)


class DistanceRange:
    """Least and largest distance from the eye over the pixels that show a surface."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        self._shader = shaders.compute("passes/distance_range.comp", {"GROUP_SIDE": GROUP_SIDE})
        self._range = context.buffer(_NOTHING.tobytes())

    def measure(self, gbuffer: GBuffer, view: View) -> tuple[float, float]:
        """m; infinity and 0 where no surface shows. Waits for the device."""
        self._range.orphan()
        self._range.write(_NOTHING.tobytes())
        self._range.bind_to_storage_buffer(int(CONSTANTS["RESULT_BINDING"]))
        gbuffer.bind()
        set_uniforms(self._shader, {"camera_position": view.position})
        width, height = gbuffer.size
        self._shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()
        nearest, farthest = np.frombuffer(self._range.read(), np.float32)
        return float(nearest), float(farthest)
