# SPDX-License-Identifier: GPL-3.0-or-later
"""What a picture shows, counted on the device: what effects it calls for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ...core.scene import Float32
from ...core.scene_facts import ScreenFacts
from ..gpu_layout import CONSTANTS
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE, BLOCK_SIDE = 4, 8
"""Invocations of a work group, and pixels that each counts, along a side."""
_SIGN = np.uint32(0x80000000)
_EMPTY = np.array([0, 0, *(3 * [0xFFFFFFFF]), *(3 * [0])], np.uint32)


class ScreenCensusPass:
    """Counts what pixels show; reads some bytes back, so it waits for the device."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, *, counts_glossy: bool = True) -> None:
        """counts_glossy: False where no material is, so that none need be looked at."""
        self._context = context
        defines = {"GROUP_SIDE": GROUP_SIDE, "BLOCK_SIDE": BLOCK_SIDE, "COUNTS_GLOSSY": counts_glossy}
        self._shader = shaders.compute("passes/screen_census.comp", defines)
        self._counts = context.buffer(reserve=_EMPTY.nbytes)

    def render(self, gbuffer: GBuffer, space: LocalSpace) -> ScreenFacts:
        """What `gbuffer`, in local units of `space`, shows; its bounds in world space."""
        # New storage: llvmpipe (Mesa 22) lets a write overtake work that still reads the old one.
        self._counts.orphan()
        self._counts.write(_EMPTY.tobytes())
        self._counts.bind_to_storage_buffer(int(CONSTANTS["RESULT_BINDING"]))
        gbuffer.bind()
        width, height = gbuffer.size
        side = GROUP_SIDE * BLOCK_SIDE
        self._shader.run(-(-width // side), -(-height // side))
        self._context.memory_barrier()
        found = np.frombuffer(self._counts.read(), np.uint32)
        shown, glossy = int(found[0]), int(found[1])
        low, high = (space.world_points(_from_ordered_bits(part)) for part in (found[2:5], found[5:8]))
        return ScreenFacts(width * height, shown, glossy, low, high)


def _from_ordered_bits(bits: npt.NDArray[np.uint32]) -> Float32:
    """The numbers whose bits were put in order."""
    plain = np.where(bits & _SIGN, bits ^ _SIGN, ~bits)
    return plain.astype(np.uint32).view(np.float32)
